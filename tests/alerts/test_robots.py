"""Robots are stopped, run out of charge and disk, have a wrong clock, and cannot send their recordings."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path

import pytest

from alerts.watched import SINGLE, WatchedSite, watched
from faults.site import Layout
from nena_shared.clock import SAMPLES
from nena_shared.vda5050.own_actions import FETCH_RECORDING
from support.order_service_fleet import order_in
from support.shifted_clock import ShiftedClock
from support.small_disk import SmallDisk, small_disk

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(1200)]

DISK_MB = 260
FAR_STATIONS = ("Station 10", "Station 8")
"""No other robot passes there, so none has to wait."""
LEFT = 150_000_000
"""Bytes, less than the 200 MB of the rule."""
RECORDINGS_MB = 8


@asynccontextmanager
async def emergency_stop(site: WatchedSite, serial: str) -> AsyncIterator[None]:
    """Press the emergency stop of a robot, and release it at the end."""
    site.control(serial, "emergencyStop", stop="MANUAL")
    yield
    site.control(serial, "acknowledgeEmergencyStop")


@asynccontextmanager
async def empty_battery(site: WatchedSite, serial: str) -> AsyncIterator[None]:
    """Leave a robot with little charge, and exchange its battery at the end."""
    site.control(serial, "battery", stateOfCharge=8)
    yield
    site.control(serial, "battery", stateOfCharge=100)


@asynccontextmanager
async def wrong_clock(clock: ShiftedClock) -> AsyncIterator[None]:
    """Set a clock a minute ahead, and right at the end."""
    clock.jump_to(timedelta(minutes=1))
    yield
    clock.jump_to(timedelta())


@asynccontextmanager
async def ordered_by_wrong_clock(site: WatchedSite, clock: ShiftedClock, name: str) -> AsyncIterator[None]:
    """Set the clock of the order service or of a robot a minute ahead, and give the robot an order.

    At the end the clock is right, and the robot receives as many VDA orders as it remembers.
    """
    async with wrong_clock(clock):
        await drive(site, f"{name}-wrong")
        yield
    for number in range(SAMPLES // len(FAR_STATIONS)):
        await drive(site, f"{name}-right-{number}")


async def drive(site: WatchedSite, name: str) -> None:
    """Let a robot drive to two stations, by a VDA order each."""
    await site.order(name, *FAR_STATIONS, vehicle=SINGLE)
    await order_in(site.orders, name, "FINISHED")


@asynccontextmanager
async def recordings_not_stored(site: WatchedSite, disk: SmallDisk) -> AsyncIterator[None]:
    """Request a recording while the aggregator has no space for it."""
    disk.fill()
    request = {"actionType": FETCH_RECORDING}
    (await site.orders.post(f"/v1/vehicles/{SINGLE}/instantActions", json=request)).raise_for_status()
    yield
    disk.clear()


@asynccontextmanager
async def disk_almost_full(disk: SmallDisk) -> AsyncIterator[None]:
    """Leave little space on a disk."""
    disk.fill(leave=LEFT)
    yield
    disk.clear()


@asynccontextmanager
async def disk_full(site: WatchedSite, disk: SmallDisk) -> AsyncIterator[None]:
    """Leave no space on a robot's disk, and give it an order that it cannot write down.

    A journal keeps its space, so it is deleted first: the disk is also too full for a longer record.
    """
    for journal in disk.folder.glob("*.journal"):
        journal.unlink()
    disk.fill()
    await site.order("for-a-full-disk", FAR_STATIONS[0], vehicle=SINGLE)
    yield
    disk.clear()
    await order_in(site.orders, "for-a-full-disk", "FINISHED")


async def test_stops_and_battery(tmp_path: Path) -> None:
    site = WatchedSite(tmp_path, Layout(loopback=5, singles=1))
    async with watched(site) as watch:
        await watch.finds(
            emergency_stop(site, "loop-3"),
            {"NenaRobotStands": 1},
            serial_number="loop-3",
            condition="BLOCKED",
        )
        await watch.finds(empty_battery(site, "loop-5"), {"NenaRobotBatteryLow": 1}, serial_number="loop-5")


async def test_clocks(tmp_path: Path) -> None:
    own, fleet = (ShiftedClock(make_folder(tmp_path / each)) for each in ("own", "fleet"))
    environments = {"single_1": own.environment, "order_service": fleet.environment}
    site = WatchedSite(tmp_path, Layout(loopback=2, singles=1), **environments)
    async with watched(site) as watch:
        await watch.finds(wrong_clock(own), {"NenaRobotClockWrong": 1}, serial_number=SINGLE)
        await watch.finds(
            ordered_by_wrong_clock(site, own, "robot"),
            {"NenaRobotClockWrong": 1, "NenaAgentClockWrong": 1},
            serial_number=SINGLE,
        )
        await watch.finds(
            ordered_by_wrong_clock(site, fleet, "fleet"),
            {"NenaOrderServiceClockWrong": 1, "NenaAgentClockWrong": 1},
        )


def make_folder(path: Path) -> Path:
    """Create a folder and return it."""
    path.mkdir()
    return path


async def test_recordings_wait(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", megabytes=RECORDINGS_MB) as disk:
        site = WatchedSite(tmp_path, Layout(loopback=2, singles=1))
        site.recordings = disk.folder
        async with watched(site) as watch:
            await watch.finds(
                recordings_not_stored(site, disk), {"NenaRecordingsWait": 1}, job="nena-edge-agent"
            )
            (stored,) = disk.folder.rglob("*-request.mcap")
            assert stored.stat().st_size


async def test_disk_of_an_agent(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", megabytes=DISK_MB) as disk:
        site = WatchedSite(tmp_path, Layout(loopback=2, singles=1))
        site.single_journal = disk.folder
        async with watched(site) as watch:
            await watch.finds(disk_almost_full(disk), {"NenaAgentDiskLow": 1})
            await watch.finds(
                disk_full(site, disk),
                {"NenaAgentDiskLow": 1, "NenaAgentJournalFails": 1, "NenaRobotStands": 1},
            )
