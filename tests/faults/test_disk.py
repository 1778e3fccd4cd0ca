"""The disk of services and robots is full for a while: what cannot be kept is not answered."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from faults.extent import TIMES, only_in_whole
from faults.host import Host
from support.small_disk import SmallDisk, small_disk
from support.waiting import until

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1200)]

REFUSED_WITHIN = 120.0
MORE = 20
"""Orders more than usual that the host wants to have under way: some may still find room."""
UNAVAILABLE = 503


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    with small_disk(tmp_path / "disk", megabytes=48) as made:
        yield made


def fill(disk: SmallDisk) -> None:
    """Fill the disk, with no room left in the log of the store, which would be written over for long."""
    with closing(sqlite3.connect(disk.folder / "orders.db", timeout=REFUSED_WITHIN)) as store:
        busy, *_ = store.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    assert not busy
    disk.fill()


async def refused_for_lack_of_room(host: Host) -> None:
    """Create more orders, and wait until one is refused because the store is full."""
    host.put_off.clear()
    host.at_once += MORE
    await until(
        lambda: any("full" in detail for _, detail in host.put_off),
        timeout=REFUSED_WITHIN,
        what="orders are refused for lack of room",
    )
    assert {status for status, _ in host.put_off} == {UNAVAILABLE}
    host.at_once -= MORE


@only_in_whole
async def test_full_and_free_again(trial: Callable[..., Any], disk: SmallDisk) -> None:
    async with trial(seed=9, data=disk.folder) as running:
        for _ in range(TIMES):
            fill(disk)
            await refused_for_lack_of_room(running.host)
            disk.clear()
            await running.recovers("disk full")


@only_in_whole
async def test_killed_while_it_is_full(trial: Callable[..., Any], disk: SmallDisk) -> None:
    """Order service and robots die with the disk full, and begin with it full: they wait for room."""
    async with trial(seed=10, data=disk.folder) as running:
        for _ in range(TIMES):
            fill(disk)
            await refused_for_lack_of_room(running.host)
            for name in ("order-service", "loopback"):
                running.site.programs[name].kill()
            before = len(running.site.programs["order-service"].log)
            began = running.site.start_order_service()
            running.site.start_loopback()
            await began.logged("database unavailable", start=before)
            disk.clear()
            await running.recovers("killed while the disk is full")
