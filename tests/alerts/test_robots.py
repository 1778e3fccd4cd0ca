"""Robots are stopped, run out of charge and disk, and have a wrong clock."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import timedelta
from pathlib import Path

import pytest

from alerts.watched import SINGLE, WatchedSite, watched
from faults.site import Layout
from support.order_service_fleet import order_in
from support.shifted_clock import ShiftedClock
from support.small_disk import SmallDisk, small_disk

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(1200)]

DISK_MB = 260
FAR_STATION = "Station 10"
"""No other robot passes there, so none has to wait."""
LEFT = 150_000_000
"""Bytes, less than the 200 MB of the rule."""


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
    await site.order("for-a-full-disk", FAR_STATION, vehicle=SINGLE)
    yield
    disk.clear()
    await order_in(site.orders, "for-a-full-disk", "FINISHED")


async def test_stops_battery_and_clock(tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    site = WatchedSite(tmp_path, Layout(loopback=5, singles=1), single_1=clock.environment)
    async with watched(site) as watch:
        await watch.finds(
            emergency_stop(site, "loop-3"),
            {"NenaRobotStands": 1},
            serial_number="loop-3",
            condition="BLOCKED",
        )
        await watch.finds(empty_battery(site, "loop-5"), {"NenaRobotBatteryLow": 1}, serial_number="loop-5")
        await watch.finds(wrong_clock(clock), {"NenaRobotClockWrong": 1}, serial_number=SINGLE)


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
