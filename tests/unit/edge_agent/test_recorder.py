from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from nena_edge_agent import recorder as recorder_module
from nena_edge_agent.journal import Journal
from nena_edge_agent.protocol.memory import Memory
from nena_edge_agent.recorder import Recorder
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import Bench, order

ROBOT = RobotKey("ACME", "0001")
WAIT = 30.0


class SlowDisk(Journal):
    """A journal on a disk that takes its time, as long as the test wants."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, ROBOT)
        self.may_write, self.may_sync = threading.Event(), threading.Event()
        self.records = 0

    def write(self, memory: Memory) -> None:
        assert self.may_write.wait(WAIT)
        super().write(memory)
        self.records += 1

    def sync(self) -> None:
        assert self.may_sync.wait(WAIT)
        super().sync()


class Rig:
    """A recorder, a robot to record, and what the recorder tells."""

    def __init__(self, journal: Journal | None) -> None:
        self.bench = Bench()
        self.told: list[str] = []
        self.woken = asyncio.Event()
        core = self.bench.core
        self.recorder = Recorder(journal, core.durable_version, tell=self.told.append, wake=self.woken.set)

    async def write(self) -> None:
        core = self.bench.core
        await self.recorder.write(core.durable_version, core.memory)


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """No disk counts as one that hangs because the machine is slow."""
    monkeypatch.setattr(recorder_module, "PATIENCE", WAIT)


@pytest.fixture
async def disk(tmp_path: Path) -> AsyncIterator[SlowDisk]:
    disk = SlowDisk(tmp_path)
    yield disk
    disk.may_write.set()
    disk.may_sync.set()


async def test_what_is_new_is_recorded_once(disk: SlowDisk, tmp_path: Path) -> None:
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
async def test_a_disk_that_hangs_is_told_and_gets_the_newest_record_later(
    disk: SlowDisk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hangs_at: str
) -> None:
    monkeypatch.setattr(recorder_module, "PATIENCE", 0.05)
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
    monkeypatch.setattr(recorder_module, "PATIENCE", WAIT)
    await rig.write()
    await rig.recorder.sync()

    assert rig.told[-1] == ""
    assert Journal(tmp_path, ROBOT).read() == rig.bench.core.memory()


async def test_a_disk_that_fails_is_told_and_tried_again(tmp_path: Path) -> None:
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


async def test_what_was_recorded_is_known(disk: SlowDisk) -> None:
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


async def test_a_record_that_failed_is_not_taken_for_one(tmp_path: Path) -> None:
    rig = Rig(Journal(tmp_path / "nowhere", ROBOT))
    rig.bench.send(order("n0", "n1"))

    await rig.write()
    await rig.recorder.sync()

    assert not rig.recorder.has_written(rig.bench.core.durable_version)
    assert not rig.recorder.has_synced(rig.bench.core.durable_version)


async def test_what_a_failed_record_may_have_overwritten_is_written_again(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    rig = Rig(Journal(folder, ROBOT))
    before = rig.bench.core.durable_version
    rig.bench.send(order("n0", "n1"))
    await rig.write()
    await rig.recorder.sync()

    assert not rig.recorder.has_written(before)
    assert not rig.recorder.has_synced(before)
