from __future__ import annotations

import os
from pathlib import Path

import pytest

from nena_edge_agent.journal import Journal, sole_user
from nena_edge_agent.protocol.memory import Memory
from nena_shared.program import StartError
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import Bench, action, order

ROBOT = RobotKey("ACME", "0001")
FILE = "ACME.0001.journal"


def busy() -> Bench:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD")]}))
    return bench


def record(journal: Journal, memory: Memory) -> None:
    journal.write(memory)
    journal.sync()


def test_there_is_nothing_before_the_first_record(tmp_path: Path) -> None:
    assert Journal(tmp_path / "new" / "folder", ROBOT).read() is None


def test_the_newest_record_is_read_back_as_it_was(tmp_path: Path) -> None:
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
def test_no_two_robots_share_a_file(tmp_path: Path, one: RobotKey, other: RobotKey) -> None:
    memory = busy().core.memory()
    record(Journal(tmp_path, one), memory)

    assert Journal(tmp_path, other).read() is None
    assert Journal(tmp_path, one).read() == memory
    with sole_user(tmp_path, one), sole_user(tmp_path, other):
        pass


def test_records_are_written_over_each_other_in_turn(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    before = (tmp_path / FILE).stat()
    for _ in range(3):
        bench.arrive()
        record(journal, bench.core.memory())
        assert Journal(tmp_path, ROBOT).read() == bench.core.memory()

    after = (tmp_path / FILE).stat()
    assert (after.st_ino, after.st_size) == (before.st_ino, before.st_size)


def test_the_next_program_goes_on_where_the_last_one_ended(tmp_path: Path) -> None:
    bench = busy()
    for _ in range(5):
        bench.arrive()
        journal = Journal(tmp_path, ROBOT)
        journal.read()
        record(journal, bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_a_longer_record_gets_more_room(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    longer = Bench()
    longer.send(order(*(f"n{number}" for number in range(500))))
    record(journal, longer.core.memory())
    assert Journal(tmp_path, ROBOT).read() == longer.core.memory()

    record(journal, bench.core.memory())
    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


def test_a_torn_write_leaves_the_old_record(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    for _ in range(2):
        record(journal, bench.core.memory())
    old, before = bench.core.memory(), (tmp_path / FILE).read_bytes()
    bench.arrive()
    journal.write(bench.core.memory())
    new, after = bench.core.memory(), (tmp_path / FILE).read_bytes()

    seen = []
    for cut in range(0, len(after) + 1, 64):
        (tmp_path / FILE).write_bytes(after[:cut] + before[cut:])
        seen.append(Journal(tmp_path, ROBOT).read())

    assert (seen[0], seen[-1]) == (old, new)
    assert seen == [old] * seen.count(old) + [new] * seen.count(new)


def test_what_the_disk_may_not_have_is_never_the_only_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    journal.write(bench.core.memory())  # and is torn
    after = (tmp_path / FILE).read_bytes()
    torn = bytes(one if one == other else 0 for one, other in zip(before, after, strict=True))
    (tmp_path / FILE).write_bytes(torn)

    assert Journal(tmp_path, ROBOT).read() == old


def test_a_file_that_was_removed_meanwhile_is_made_again(tmp_path: Path) -> None:
    bench, journal = busy(), Journal(tmp_path, ROBOT)
    record(journal, bench.core.memory())
    (tmp_path / FILE).unlink()
    record(journal, bench.core.memory())

    assert Journal(tmp_path, ROBOT).read() == bench.core.memory()


@pytest.mark.parametrize("content", ["", "{", "[]", '{"format": 1}', "0 \n{}", " " * 9000])
def test_a_damaged_record_is_never_guessed_at(tmp_path: Path, content: str) -> None:
    (tmp_path / FILE).write_text(content)

    with pytest.raises(StartError, match="remove the file"):
        Journal(tmp_path, ROBOT).read()


def test_a_record_that_is_whole_and_not_understood_is_told(tmp_path: Path) -> None:
    record(Journal(tmp_path, ROBOT), busy().core.memory().model_copy(update={"queue": ("a", "b", None)}))

    with pytest.raises(StartError, match="remove the file"):
        Journal(tmp_path, ROBOT).read()


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    with pytest.raises(StartError, match="cannot be used"):
        Journal(tmp_path / "file", ROBOT).read()


@pytest.mark.parametrize("folder", ["/proc/nena", "~nobody-of-this-name/nena"])
def test_a_folder_that_cannot_be_written_is_told_before_an_order_depends_on_it(folder: str) -> None:
    with pytest.raises(StartError, match=r"set journal\.folder"):
        Journal(Path(folder), ROBOT).read()
    with pytest.raises(StartError, match=r"set journal\.folder"), sole_user(Path(folder), ROBOT):
        pass


def test_a_second_program_for_the_same_robot_is_kept_out_as_long_as_the_first_one_works(
    tmp_path: Path,
) -> None:
    with sole_user(tmp_path, ROBOT):
        with pytest.raises(StartError, match="ACME/0001: end it first"), sole_user(tmp_path, ROBOT):
            pass
        with sole_user(tmp_path, RobotKey("ACME", "0002")):
            pass
    with sole_user(tmp_path, ROBOT):
        pass
