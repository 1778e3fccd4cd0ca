from __future__ import annotations

import asyncio
import errno
import os
import shutil
import threading
from collections.abc import AsyncIterator
from pathlib import Path
from zlib import crc32

import pytest

from nena_edge_agent import journal as journal_module
from nena_edge_agent.factsheet import frame_of
from nena_edge_agent.journal import (
    BLOCK,
    Journal,
    Recorder,
    UnreadableJournalError,
    check_frame,
    lock_journal,
    read_journal,
    record_of,
)
from nena_edge_agent.protocol.memory import Memory
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.tasks import StartError
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import Bench, action, order

ROBOT = RobotKey("ACME", "0001")
FILE = "ACME.0001.journal"
OF_AN_EARLIER_RELEASE = Path(__file__).parents[2] / "fixtures/journals/format-1/ACME.0001.journal"


def busy() -> Bench:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD")]}))
    return bench


def record(journal: Journal, memory: Memory) -> None:
    journal.write(record_of(memory))
    journal.sync()


def test_an_empty_folder_has_no_record(tmp_path: Path) -> None:
    assert Journal(tmp_path / "new" / "folder", ROBOT).read() is None


def test_the_newest_record_is_read_unchanged(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    journal.read()
    record(journal, bench.core.memory())
    bench.arrive()
    record(journal, bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()
    assert Journal(tmp_path, RobotKey("ACME", "0002")).read() is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (RobotKey("ACME.B", "C"), RobotKey("ACME", "B.C")),
        (RobotKey("ACME%2EB", "C"), RobotKey("ACME.B", "C")),
        (RobotKey("..", "C"), RobotKey(".", ".C")),
    ],
)
def test_each_robot_has_its_own_file(tmp_path: Path, one: RobotKey, other: RobotKey) -> None:
    memory = busy().core.memory()
    record(Journal(tmp_path, one), memory)

    assert Journal(tmp_path, other).read() is None
    assert Journal(tmp_path, one).read() == memory
    with lock_journal(tmp_path, one), lock_journal(tmp_path, other):
        pass


def test_records_overwrite_each_other_alternately(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    before = (tmp_path / FILE).stat()
    for _ in range(3):
        bench.arrive()
        record(journal, bench.core.memory())
        assert Journal(tmp_path, ROBOT).read() == bench.core.memory()

    after = (tmp_path / FILE).stat()
    assert (after.st_ino, after.st_size) == (before.st_ino, before.st_size)


def test_the_next_run_continues_with_the_last_record(tmp_path: Path) -> None:
    bench = busy()
    for _ in range(5):
        bench.arrive()
        journal = Journal(tmp_path, ROBOT)
        journal.read()
        record(journal, bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_a_longer_record_gets_a_larger_file(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    longer = Bench()
    longer.send(order(*(f"n{number}" for number in range(500))))
    record(journal, longer.core.memory())
    assert Journal(tmp_path, ROBOT).read() == longer.core.memory()

    record(journal, bench.core.memory())
    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_a_record_that_the_disk_takes_in_part_is_reported_and_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, old := bench.core.memory())
    bench.arrive()
    write_all = os.pwrite
    with monkeypatch.context() as disk:
        disk.setattr(os, "pwrite", lambda file, data, offset: write_all(file, data[:BLOCK], offset))
        with pytest.raises(OSError, match="only a part"):
            journal.write(record_of(bench.core.memory()))
    assert Journal(tmp_path, ROBOT).read() == old

    record(journal, bench.core.memory())
    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_an_interrupted_write_leaves_the_old_record(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    for _ in range(2):
        record(journal, bench.core.memory())
    old, before = bench.core.memory(), (tmp_path / FILE).read_bytes()
    bench.arrive()
    journal.write(record_of(bench.core.memory()))
    new, after = bench.core.memory(), (tmp_path / FILE).read_bytes()

    seen = []
    for cut in range(0, len(after) + 1, 64):
        (tmp_path / FILE).write_bytes(after[:cut] + before[cut:])
        seen.append(Journal(tmp_path, ROBOT).read())

    assert (seen[0], seen[-1]) == (old, new)
    assert seen == [old] * seen.count(old) + [new] * seen.count(new)


def every_other_block(before: bytes, after: bytes) -> bytes:
    """Mix two contents as on a disk that has written only some blocks, in its own order."""
    starts = range(0, len(after), 2 * BLOCK)
    return b"".join(
        before[start : start + BLOCK] + after[start + BLOCK : start + 2 * BLOCK] for start in starts
    )


@pytest.mark.parametrize("restarted", [True, False])
def test_blocks_of_two_failed_records_are_not_mistaken_for_one_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, restarted: bool
) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    for _ in range(2):
        record(journal, bench.core.memory())
    old, before = bench.core.memory(), (tmp_path / FILE).read_bytes()

    def fail(_: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    bench.arrive()
    journal.write(record_of(bench.core.memory()))
    with monkeypatch.context() as disk:
        disk.setattr(os, "fdatasync", fail)
        with pytest.raises(OSError, match="Input/output"):
            journal.sync()
    (tmp_path / FILE).write_bytes(every_other_block(before, (tmp_path / FILE).read_bytes()))
    if restarted:
        journal = Journal(tmp_path, ROBOT)
        assert journal.read() == old
    first = (tmp_path / FILE).read_bytes()
    bench.arrive()
    journal.write(record_of(bench.core.memory()))
    new, after = bench.core.memory(), (tmp_path / FILE).read_bytes()
    assert Journal(tmp_path, ROBOT).read() == new

    (tmp_path / FILE).write_bytes(every_other_block(after, first))
    assert Journal(tmp_path, ROBOT).read() == old


@pytest.mark.parametrize("damage", ["one bit", "a block of zeros", "the first label", "all of it"])
def test_a_damaged_newest_record_is_not_mistaken_for_an_interrupted_write(
    tmp_path: Path, damage: str
) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    for _ in range(3):
        record(journal, bench.core.memory())
    content = bytearray((tmp_path / FILE).read_bytes())
    newest = len(content) // 2  # the third record: odd numbers are in the second half
    match damage:
        case "one bit":
            content[newest + 200] ^= 1
        case "a block of zeros":
            content[newest + BLOCK : newest + 2 * BLOCK] = bytes(BLOCK)
        case "the first label":
            content[newest + 12] ^= 1
        case _:
            content[newest:] = bytes(len(content) - newest)
    (tmp_path / FILE).write_bytes(content)

    with pytest.raises(UnreadableJournalError, match="the journal is damaged: remove"):
        Journal(tmp_path, ROBOT).read()


def test_damage_of_the_older_record_is_no_loss(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    for _ in range(3):
        record(journal, bench.core.memory())
    content = bytearray((tmp_path / FILE).read_bytes())
    content[200] ^= 1
    (tmp_path / FILE).write_bytes(content)

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_a_journal_of_an_earlier_release_is_continued(tmp_path: Path) -> None:
    shutil.copy(OF_AN_EARLIER_RELEASE, tmp_path / FILE)
    memory = Journal(tmp_path, ROBOT).read()
    assert memory is not None
    journal = Journal(tmp_path, ROBOT)
    journal.read()
    for paused in (True, False):
        record(journal, memory.model_copy(update={"paused": paused}))
        kept = Journal(tmp_path, ROBOT).read()
        assert kept is not None
        assert kept.paused is paused


def test_an_unsynced_record_is_never_the_only_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    old, before = bench.core.memory(), (tmp_path / FILE).read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    bench.arrive()
    with monkeypatch.context() as patch:
        patch.setattr(os, "fdatasync", full)
        with pytest.raises(OSError, match="No space"):
            record(journal, bench.core.memory())
    journal.write(record_of(bench.core.memory()))  # and is torn
    after = (tmp_path / FILE).read_bytes()
    (tmp_path / FILE).write_bytes(every_other_block(before, after))

    assert Journal(tmp_path, ROBOT).read() == old


def test_a_file_that_was_removed_is_created_again(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    (tmp_path / FILE).unlink()
    record(journal, bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 1}', "0 \n{}", " " * 9000])
def test_a_damaged_record_is_never_read(tmp_path: Path, content: str) -> None:
    (tmp_path / FILE).write_text(content)

    with pytest.raises(UnreadableJournalError, match=f"is damaged: remove {tmp_path / FILE} and restart"):
        Journal(tmp_path, ROBOT).read()


def test_a_complete_but_deeply_nested_record_is_reported(tmp_path: Path) -> None:
    rest = b"1\n" + b"[" * 100_000
    half = b"%08x " % crc32(rest) + rest
    (tmp_path / FILE).write_bytes(half + b" " * len(half))

    with pytest.raises(UnreadableJournalError, match="is damaged"):
        Journal(tmp_path, ROBOT).read()


def test_a_complete_but_unreadable_record_is_reported(tmp_path: Path) -> None:
    record(Journal(tmp_path, ROBOT), busy().core.memory().model_copy(update={"queue": ("a", "b", None)}))

    with pytest.raises(UnreadableJournalError, match="is damaged"):
        Journal(tmp_path, ROBOT).read()


def test_a_journal_of_any_length_is_read_correctly_or_not_at_all(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    older = bench.core.memory().model_dump_json(exclude_defaults=True).encode()
    bench.arrive()
    record(journal, bench.core.memory())
    newer = bench.core.memory().model_dump_json(exclude_defaults=True).encode()
    whole = (tmp_path / FILE).read_bytes()

    found = set()
    for content in (*(whole[:end] for end in range(len(whole))), *(whole + b"x" * n for n in range(1, 99))):
        try:
            found.add(journal_module._newest_record(content)[1].rstrip())
        except ValueError:
            found.add(b"nothing")

    assert found <= {older, newer, b"nothing"}
    assert b"nothing" in found


@pytest.mark.parametrize("number", [0, 2])
def test_a_record_of_another_version_is_reported(tmp_path: Path, number: int) -> None:
    record(Journal(tmp_path, ROBOT), busy().core.memory().model_copy(update={"format": number}))

    with pytest.raises(
        UnreadableJournalError, match="from another version of the agent: reinstall that version"
    ):
        Journal(tmp_path, ROBOT).read()


def test_a_record_contains_its_format(tmp_path: Path) -> None:
    record(Journal(tmp_path, ROBOT), busy().core.memory())

    assert b'"format":1' in (tmp_path / FILE).read_bytes()


def test_a_record_that_cannot_be_read_from_disk_is_reported(tmp_path: Path) -> None:
    (tmp_path / FILE).mkdir()  # reading it fails, whoever the user is

    with pytest.raises(UnreadableJournalError, match=r"cannot be read \(Is a directory\)"):
        Journal(tmp_path, ROBOT).read()


def test_reading_a_journal_returns_the_memory_or_the_reason(tmp_path: Path) -> None:
    assert read_journal(None) == (None, "")
    assert read_journal(Journal(tmp_path, ROBOT)) == (None, "")
    memory = busy().core.memory()
    record(Journal(tmp_path, ROBOT), memory)
    assert read_journal(Journal(tmp_path, ROBOT)) == (memory, "")
    (tmp_path / FILE).write_bytes(b"")
    assert "is damaged" in read_journal(Journal(tmp_path, ROBOT))[1]


def test_a_full_disk_is_reported_with_a_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "open", full)
    with pytest.raises(StartError, match="No space left on device; free space on its disk"):
        lock_journal(tmp_path, ROBOT).__enter__()


def test_a_folder_that_cannot_be_created_is_reported(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(StartError, match="cannot be used"):
        Journal(tmp_path / "file", ROBOT).read()


@pytest.mark.parametrize("folder", ["/proc/nena", "~nobody-of-this-name/nena"])
def test_an_unwritable_folder_is_reported_before_an_order_depends_on_it(folder: str) -> None:
    with pytest.raises(StartError, match=r"set journal\.folder"):
        Journal(Path(folder), ROBOT).read()
    with pytest.raises(StartError, match=r"set journal\.folder"), lock_journal(Path(folder), ROBOT):
        pass


def test_a_second_program_for_the_same_robot_is_refused_while_the_first_one_runs(
    tmp_path: Path,
) -> None:
    with lock_journal(tmp_path, ROBOT):
        with pytest.raises(StartError, match="ACME/0001: stop it first"), lock_journal(tmp_path, ROBOT):
            pass
        with lock_journal(tmp_path, RobotKey("ACME", "0002")):
            pass
    with lock_journal(tmp_path, ROBOT):
        pass


WAIT = 30.0


class SlowDisk(Journal):
    """A journal on a disk that takes as long as the test wants."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, ROBOT)
        self.may_write, self.may_sync = threading.Event(), threading.Event()
        self.records = 0

    def write(self, record: bytes) -> None:
        assert self.may_write.wait(WAIT)
        super().write(record)
        self.records += 1

    def sync(self) -> None:
        assert self.may_sync.wait(WAIT)
        super().sync()


class Rig:
    """A recorder, a robot to record, and the recorder's reports."""

    def __init__(self, journal: Journal | None) -> None:
        self.bench = Bench()
        self.told: list[str] = []
        self.woken = asyncio.Event()
        core = self.bench.core
        self.recorder = Recorder(
            journal, core.durable_version, on_record=self.told.append, wake=self.woken.set
        )

    async def write(self) -> None:
        core = self.bench.core
        await self.recorder.write(core.durable_version, core.memory)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No disk counts as one that hangs because the machine is slow."""
    monkeypatch.setattr(journal_module, "WRITE_TIMEOUT", WAIT)


@pytest.fixture
async def disk(tmp_path: Path) -> AsyncIterator[SlowDisk]:
    disk = SlowDisk(tmp_path)
    yield disk
    disk.may_write.set()
    disk.may_sync.set()


async def test_a_change_is_recorded_once(disk: SlowDisk, tmp_path: Path) -> None:
    disk.may_write.set()
    disk.may_sync.set()
    rig = Rig(disk)
    for _ in range(2):
        await rig.write()
        await rig.recorder.sync()
    assert disk.records == 0

    rig.bench.send(order("n0", "n1"))
    for _ in range(3):
        await rig.write()
        await rig.recorder.sync()

    assert disk.records == 1
    assert set(rig.told) == {""}
    assert Journal(tmp_path, ROBOT).read() == rig.bench.core.memory()


async def test_a_record_outlives_the_process_before_the_disk_has_it(disk: SlowDisk, tmp_path: Path) -> None:
    disk.may_write.set()
    rig = Rig(disk)
    rig.bench.send(order("n0", "n1"))

    await rig.write()
    assert Journal(tmp_path, ROBOT).read() == rig.bench.core.memory()
    assert not rig.told

    disk.may_sync.set()
    await rig.recorder.sync()
    assert rig.told == [""]


@pytest.mark.parametrize("hangs_at", ["write", "sync"])
async def test_a_hanging_disk_is_reported_and_gets_the_newest_record_later(
    disk: SlowDisk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hangs_at: str
) -> None:
    monkeypatch.setattr(journal_module, "WRITE_TIMEOUT", 0.05)
    if hangs_at == "sync":
        disk.may_write.set()
    rig = Rig(disk)
    rig.bench.send(order("n0", "n1"))
    await rig.write()
    await rig.recorder.sync()
    assert rig.told == ["the disk does not answer"]

    rig.bench.arrive()
    await rig.write()  # nothing gets in between
    await rig.recorder.sync()
    assert rig.told == ["the disk does not answer"]

    disk.may_write.set()
    disk.may_sync.set()
    async with asyncio.timeout(WAIT):
        await rig.woken.wait()
    monkeypatch.setattr(journal_module, "WRITE_TIMEOUT", WAIT)
    await rig.write()
    await rig.recorder.sync()

    assert rig.told[-1] == ""
    assert Journal(tmp_path, ROBOT).read() == rig.bench.core.memory()


async def test_a_failing_disk_is_reported_and_retried(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    rig = Rig(Journal(folder, ROBOT))
    rig.bench.send(order("n0", "n1"))
    await rig.write()
    await rig.recorder.sync()
    assert ["No such file" in each for each in rig.told] == [True]

    folder.mkdir()
    await rig.write()
    await rig.recorder.sync()
    assert rig.told[-1] == ""


async def test_without_a_journal_nothing_is_waited_for() -> None:
    rig = Rig(None)
    rig.bench.send(order("n0", "n1"))

    await rig.write()
    await rig.recorder.sync()

    assert not rig.told


async def test_a_record_is_written_before_it_is_synced(disk: SlowDisk) -> None:
    rig = Rig(disk)
    recorder, before = rig.recorder, rig.bench.core.durable_version
    assert recorder.has_written(before)
    assert recorder.has_synced(before)

    rig.bench.send(order("n0", "n1"))
    version = rig.bench.core.durable_version
    assert not recorder.has_written(version)

    disk.may_write.set()
    await rig.write()
    assert recorder.has_written(version)
    assert not recorder.has_synced(version)

    disk.may_sync.set()
    await recorder.sync()
    assert recorder.has_synced(version)


async def test_a_failed_record_is_not_read(tmp_path: Path) -> None:
    rig = Rig(Journal(tmp_path / "nowhere", ROBOT))
    rig.bench.send(order("n0", "n1"))

    await rig.write()
    await rig.recorder.sync()

    assert not rig.recorder.has_written(rig.bench.core.durable_version)
    assert not rig.recorder.has_synced(rig.bench.core.durable_version)


async def test_a_record_that_a_failed_one_may_have_overwritten_is_written_again(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    rig = Rig(Journal(folder, ROBOT))
    before = rig.bench.core.durable_version
    rig.bench.send(order("n0", "n1"))
    await rig.write()
    await rig.recorder.sync()

    assert not rig.recorder.has_written(before)
    assert not rig.recorder.has_synced(before)


TURNED = EdgeAgentSettings(map_transforms={"roof": "x=1", "hall": "rotation=90"})


def test_a_frame_is_named_by_its_transforms() -> None:
    assert frame_of(TURNED) == "hall: rotation=90; roof: x=1"
    assert frame_of(EdgeAgentSettings()) == ""
    assert frame_of(TURNED.model_copy(update={"driver": "loopback"})) == ""


def test_an_order_in_another_frame_is_not_continued() -> None:
    robot = Bench(frame=frame_of(TURNED))
    robot.send(order("n0", "n1"))
    memory = robot.core.memory()
    check_frame(memory, frame_of(TURNED))
    with pytest.raises(StartError, match="order 'o1' is active in another frame"):
        check_frame(memory, "")


def test_without_an_order_the_frame_may_change() -> None:
    check_frame(None, frame_of(TURNED))
    check_frame(Bench(frame=frame_of(TURNED)).core.memory(), "")
