"""Schedules of a real order service: kills, outages, takeovers and set clocks neither lose nor double a run.

The program under test reads a clock of its own, which a test sets to just before a planned time.
"""

from __future__ import annotations

import json
import signal
import sqlite3
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from support.order_service_fleet import Fleet, role
from support.pausing import time_passes
from support.shifted_clock import ShiftedClock
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

BODY = {"transportOrder": {"destinations": [{"locationName": "Storage"}]}, "cron": "0 6 * * *"}
SUMMER = datetime(2027, 3, 28, 1, tzinfo=UTC)
"""Berlin sets its clocks from 2:00 to 3:00."""
FIRST = datetime(2027, 3, 1, 6, tzinfo=UTC)
DAY = timedelta(days=1)
EARLIER = timedelta(seconds=2)


class Clock(ShiftedClock):
    """The clock of the order services of a test."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._shift = timedelta()

    def set(self, now: datetime) -> None:
        """Set it to this time."""
        self._shift = now - datetime.now(UTC)
        self.jump_to(self._shift)

    async def reaches(self, moment: datetime) -> None:
        """Let time pass until it shows this moment."""
        await time_passes((moment - datetime.now(UTC) - self._shift).total_seconds())


@pytest.fixture
def clock(tmp_path: Path) -> Clock:
    made = Clock(tmp_path)
    made.set(FIRST - timedelta(hours=11, minutes=30))
    return made


async def put(client: httpx.AsyncClient, name: str = "S", **fields: Any) -> None:
    answer = await client.put(f"/v1/schedules/{name}", json={**BODY, **fields})
    assert answer.status_code == 201, answer.text


async def orders(client: httpx.AsyncClient) -> list[str]:
    """Return the names of all orders, the oldest first."""
    found = (await client.get("/v1/transportOrders")).json()["transportOrders"]
    return [each["name"] for each in reversed(found)]


async def created(client: httpx.AsyncClient, number: int, name: str = "S") -> list[str]:
    """Wait until a schedule has created so many orders, and return all orders."""

    async def look() -> int:
        return int((await client.get(f"/v1/schedules/{name}")).json()["createdOrders"])

    await awaited(look, lambda found: found >= number, what=lambda: f"{number} orders of {name}", every=0.02)
    return await orders(client)


async def has(client: httpx.AsyncClient, name: str) -> list[str]:
    """Wait until there is an order of this name, and return all orders."""
    return await awaited(lambda: orders(client), lambda found: name in found, what=name, every=0.02)


def in_store(fleet: Fleet) -> tuple[list[str], list[str]]:
    """Return the orders in the store, and those that the schedule counts there."""
    with sqlite3.connect(fleet.folder / "orders.db") as database:
        names = [name for (name,) in database.execute("SELECT name FROM transport_orders ORDER BY number")]
        ((document,),) = database.execute("SELECT document FROM documents WHERE kind = 'schedule'").fetchall()
    runs = json.loads(document).get("last_runs", ())
    return names, [each["transportOrder"] for each in reversed(runs)]


@pytest.mark.parametrize(
    "delays",
    [
        pytest.param((-0.05, 0.01), id="few"),
        pytest.param(tuple(number / 100 for number in range(-5, 25, 5)), id="many", marks=pytest.mark.long),
    ],
)
async def test_killed_around_a_planned_time(fleet: Fleet, clock: Clock, delays: tuple[float, ...]) -> None:
    program = fleet.order_service(environment=clock.environment)
    await put(await program.client(), catchUp=1)  # a start may take longer than a minute
    for number, delay in enumerate(delays):
        planned = FIRST + number * DAY
        clock.set(planned - EARLIER)
        await clock.reaches(planned + timedelta(seconds=delay))
        program.kill()
        names, counted = in_store(fleet)
        assert names == counted, "an order and its schedule's progress are one transaction"

        program = fleet.order_service(environment=clock.environment)
        expected = [f"S-{FIRST + each * DAY:%Y%m%dT%H%M%SZ}" for each in range(number + 1)]
        assert await created(await program.client(), number + 1) == expected


async def test_outage(fleet: Fleet, clock: Clock) -> None:
    program = fleet.order_service(environment=clock.environment)
    client = await program.client()
    await put(client, "skip", cron="0 * * * *")
    await put(client, "catch-up", cron="0 * * * *", catchUp=2)
    program.kill()
    clock.set(FIRST + timedelta(minutes=30))

    client = await fleet.order_service(environment=clock.environment).client()
    assert await created(client, 2, "catch-up") == ["catch-up-20270301T050000Z", "catch-up-20270301T060000Z"]
    skipped = {
        each["name"]: each["skippedRuns"] for each in (await client.get("/v1/schedules")).json()["schedules"]
    }
    assert skipped == {"catch-up": 10, "skip": 12}


async def test_clock_that_is_set_back(fleet: Fleet, clock: Clock) -> None:
    client = await fleet.order_service(environment=clock.environment).client()
    await put(client)
    clock.set(FIRST - EARLIER / 4)
    assert await created(client, 1) == ["S-20270301T060000Z"]
    clock.set(FIRST - EARLIER / 4)
    await clock.reaches(FIRST + EARLIER)
    assert await orders(client) == ["S-20270301T060000Z"]
    clock.set(FIRST + DAY - EARLIER / 4)
    assert await created(client, 2) == ["S-20270301T060000Z", "S-20270302T060000Z"]


async def test_change_to_summer_time(fleet: Fleet, clock: Clock) -> None:
    clock.set(SUMMER - timedelta(hours=1, seconds=30))
    client = await fleet.order_service(environment=clock.environment).client()
    await put(client, cron="30 2 * * *", timeZone="Europe/Berlin")
    await put(client, "hourly", cron="30 * * * *", timeZone="Europe/Berlin")
    for minutes in (-30, 0, 30):
        clock.set(SUMMER + timedelta(minutes=minutes) - EARLIER / 4)
        await clock.reaches(SUMMER + timedelta(minutes=minutes))
        await created(client, int(minutes >= 0))
        await created(client, 1 + int(minutes == 30), "hourly")
    assert await orders(client) == [
        "hourly-20270328T003000Z",
        "S-20270328T010000Z",
        "hourly-20270328T013000Z",
    ]


async def test_standby_takes_over_at_a_planned_time(shared: Fleet, clock: Clock) -> None:
    first = shared.order_service(environment=clock.environment, name="first")
    client = await first.client()
    await awaited(lambda: role(client), "active".__eq__, what="the first is active")
    await put(client, cron="* * * * *", catchUp=5)
    second = await shared.order_service(environment=clock.environment, name="second").client()
    clock.set(FIRST - EARLIER / 4)
    first.process.send_signal(signal.SIGSTOP)
    try:
        await awaited(lambda: role(second), "active".__eq__, what="the second is active")
        before = await has(second, "S-20270301T060000Z")
        clock.set(FIRST + timedelta(minutes=10) - EARLIER / 4)
    finally:
        first.process.send_signal(signal.SIGCONT)
    await until(lambda: first.process.poll() is not None, timeout=PATIENCE, what="the first has ended")
    found = await has(second, "S-20270301T061000Z")
    assert found[: len(before)] == before
    schedule = (await second.get("/v1/schedules/S")).json()
    assert schedule["createdOrders"] == len(set(found)) == len(found)
    assert not any("already" in each["reason"] for each in schedule["lastRuns"])
