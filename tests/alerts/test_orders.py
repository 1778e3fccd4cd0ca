"""Orders are late or wait for long, robots jam, and messages break the standard."""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest

from alerts.watched import LOOK_EVERY, WatchedSite, watched
from faults.site import Layout
from support.order_service_fleet import order_in
from support.pausing import time_passes
from support.shifted_clock import ShiftedClock
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(1200)]

ABSENT = "single-2"
"""A vehicle of the plant model that never connects."""
QUEUE = ("loop-2", "loop-3", "loop-4", "loop-5")
"""More robots than `jam.robots`."""
SHORT_QUEUE = QUEUE[:2]
"""No more robots than `jam.robots`."""
LONG_WAIT = timedelta(minutes=31)
LONG_QUEUE_TIME = timedelta(minutes=16)
PACE = 0.5
"""Seconds between messages."""
QUIET = 5.0
"""Seconds without an order after which none is expected."""


@asynccontextmanager
async def late_order(site: WatchedSite) -> AsyncIterator[None]:
    """Create an order that cannot be in time."""
    deadline = datetime.now(UTC) + timedelta(milliseconds=300)
    await site.order("late", "Station 0", "Station 11", deadline=deadline.isoformat())
    yield


@asynccontextmanager
async def waiting_order(site: WatchedSite, clock: ShiftedClock) -> AsyncIterator[None]:
    """Create an order that waits for an absent vehicle, let half an hour pass, and withdraw it at the end."""
    await site.order("waiting", "Station 0", vehicle=ABSENT)
    clock.jump_to(LONG_WAIT)
    yield
    (await site.orders.post("/v1/transportOrders/waiting/withdrawal")).raise_for_status()


@asynccontextmanager
async def queue_behind_stopped_robot(
    site: WatchedSite, robots: tuple[str, ...], name: str
) -> AsyncIterator[None]:
    """Stop a robot at a station to which others have to go, and let it go on at the end."""
    await site.order(f"{name}-head", "Station 0", vehicle="loop-1")
    await order_in(site.orders, f"{name}-head", "FINISHED")
    site.control("loop-1", "emergencyStop", stop="MANUAL")
    for each in robots:
        await site.order(f"{name}-{each}", "Station 0", vehicle=each)
    yield
    site.control("loop-1", "acknowledgeEmergencyStop")
    for each in robots:
        await order_in(site.orders, f"{name}-{each}", "FINISHED")


@asynccontextmanager
async def long_wait_in_a_short_queue(site: WatchedSite, clock: ShiftedClock) -> AsyncIterator[None]:
    """Let two robots wait behind a stopped one, and a quarter of an hour pass."""
    async with queue_behind_stopped_robot(site, SHORT_QUEUE, "wait"):
        for each in SHORT_QUEUE:
            await robot_waits(site, each)
        await no_orders_under_way(site)
        clock.jump_to(LONG_QUEUE_TIME)
        yield


async def robot_waits(site: WatchedSite, serial: str) -> None:
    """Wait until the aggregator shows that a robot waits: only from then on does its waiting get older."""
    path = f"{site.aggregator_url}/api/v1/robots/NeNa/{serial}"
    async with httpx.AsyncClient(timeout=PATIENCE) as client:

        async def look() -> object:
            return (await client.get(path)).json()["condition"]

        await awaited(look, lambda now: now == "WAITING", what=f"{serial} waits", every=LOOK_EVERY)


async def no_orders_under_way(site: WatchedSite) -> None:
    """Wait until robots get no more orders: one under way while the clocks jump would make them differ."""
    seen: dict[int, float] = {}

    async def look() -> float:
        number = len(site.wire.received(f"{site.interface}/v2/NeNa/+/order"))
        seen.setdefault(number, time.monotonic())
        return time.monotonic() - seen[number]

    await awaited(look, lambda quiet: quiet > QUIET, what="no orders under way", every=LOOK_EVERY)


@asynccontextmanager
async def unreadable_messages(site: WatchedSite) -> AsyncIterator[None]:
    """Let a robot send unreadable messages."""

    async def send() -> None:
        while True:
            site.wire.publish(f"{site.interface}/v2/NeNa/loop-1/visualization", "{")
            await time_passes(PACE)

    sending = asyncio.create_task(send())
    yield
    sending.cancel()
    with suppress(asyncio.CancelledError):
        await sending


@asynccontextmanager
async def deviating_message(site: WatchedSite) -> AsyncIterator[None]:
    """Let a robot send one heading beyond half a turn; one beyond a turn would put all into degrees."""
    topic = f"{site.interface}/v2/NeNa/loop-1/state"
    state = json.loads(site.wire.received(topic)[-1].payload)
    state["agvPosition"]["theta"] = 1.5 * math.pi
    site.wire.publish(topic, json.dumps(state))
    yield


@asynccontextmanager
async def foreign_command(site: WatchedSite) -> AsyncIterator[None]:
    """Let another program than the order service command a robot."""
    command = {
        "headerId": 1,
        "timestamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        "version": "2.1.0",
        "manufacturer": "NeNa",
        "serialNumber": "loop-1",
        "actions": [{"actionId": "foreign", "actionType": "stateRequest", "blockingType": "NONE"}],
    }
    site.wire.publish(f"{site.interface}/v2/NeNa/loop-1/instantActions", json.dumps(command))
    yield


async def test_late_and_waiting_orders(tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    layout = Layout(loopback=2, singles=2, robots_in=clock.environment, services_in=clock.environment)
    site = WatchedSite(tmp_path, layout)
    async with watched(site) as watch:
        await watch.finds(late_order(site), {"NenaOrderLate": 1})
        await watch.finds(waiting_order(site, clock), {"NenaOrderWaitsLong": 1})


async def test_jam_has_one_alert_that_names_its_head(tmp_path: Path) -> None:
    site = WatchedSite(tmp_path, Layout(singles=1))
    async with watched(site) as watch:
        jam = queue_behind_stopped_robot(site, QUEUE, "jam")
        alerts = await watch.finds(jam, {"NenaRobotStands": 1, "NenaJam": 1})
        assert [each["head"] for each in alerts if each["alertname"] == "NenaJam"] == ["loop-1"]


async def test_robots_that_wait_long_without_a_jam(tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    layout = Layout(singles=1, robots_in=clock.environment, services_in=clock.environment)
    site = WatchedSite(tmp_path, layout)
    async with watched(site) as watch:
        await watch.finds(
            long_wait_in_a_short_queue(site, clock),
            {"NenaRobotStands": 1, "NenaRobotsWaitLong": 1, "NenaTrafficJam": 1},  # no other robot drives
        )


async def test_messages_that_break_the_standard(tmp_path: Path) -> None:
    site = WatchedSite(tmp_path, Layout(loopback=2, singles=1))
    async with watched(site) as watch:
        await watch.finds(unreadable_messages(site), {"NenaMessagesMalformed": 1}, topic="visualization")
        await watch.finds(deviating_message(site), {"NenaMessagesRepaired": 1}, severity="info")
        await watch.finds(foreign_command(site), {"NenaForeignCommands": 1}, severity="critical")
