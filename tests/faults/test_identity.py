"""A robot that exists twice, or is replaced: its order ends once, with a reason, and all others continue."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import pytest

from faults.conftest import Trial
from faults.extent import TIMES, only_in_whole
from faults.hall import start_of
from faults.site import Site
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1200), only_in_whole]

WITHIN = 120.0
FURTHER = 10
"""Orders that end while a robot is there twice."""
SINGLE, OTHER = "single-1", "single-2"


async def vehicle(site: Site, name: str) -> dict[str, Any]:
    """Return the order service's status of a vehicle."""
    try:
        found: dict[str, Any] = (await site.orders.get(f"/v1/vehicles/{name}")).raise_for_status().json()
    except httpx.HTTPError:
        return {}
    return found


async def at_an_order(site: Site, name: str) -> tuple[float, float]:
    """Wait until a vehicle drives for an order, and return its position, m."""
    found = await awaited(
        lambda: vehicle(site, name),
        lambda now: bool(now.get("transportOrder")) and now["state"] == "EXECUTING",
        seconds=WITHIN,
        what=f"{name} is at an order",
    )
    place = found["precisePosition"]
    return place["x"], place["y"]


async def with_single(running: Trial) -> None:
    """Start the robot that has its own program."""
    running.site.start_single(SINGLE, at=start_of(len(running.site.serials)), machine="first")
    await running.site.robots_are("ONLINE", SINGLE)


async def test_replaced_by_a_machine_without_a_journal(trial: Callable[..., Any]) -> None:
    """Replace the machine during an order, which the new one does not have: it fails, because the load may be
    anywhere.
    """
    async with trial(seed=13, singles=1) as running:
        site = running.site
        await with_single(running)
        machine = "first"
        for number in range(TIMES):
            place = await at_an_order(site, SINGLE)
            site.programs.pop(machine).kill()
            await site.robots_are("ONLINE")
            machine = f"new-{number}"
            site.start_single(SINGLE, at=place, machine=machine)
            site.may_fail += 1
            await site.robots_are("ONLINE", SINGLE)
            await running.recovers("robot replaced by a new machine")
            await at_an_order(site, SINGLE)


async def test_another_robot_in_its_place(trial: Callable[..., Any]) -> None:
    """Take the old one out of traffic, which ends its order; the other one is at the same place."""
    async with trial(seed=14, singles=2) as running:
        site = running.site
        await with_single(running)
        place = await at_an_order(site, SINGLE)
        site.programs.pop("first").kill()
        site.may_fail += 1
        body = {"integrationLevel": "TO_BE_IGNORED"}
        await site.orders.put(f"/v1/vehicles/{SINGLE}/integrationLevel", json=body)
        site.start_single(OTHER, at=place, machine="second")
        await site.robots_are("ONLINE", OTHER)
        await running.recovers("another robot in its place")
        await at_an_order(site, OTHER)


async def test_two_programs_with_one_identity(trial: Callable[..., Any]) -> None:
    """Run two programs with one identity: they disconnect each other at the broker at growing intervals, and
    log it.

    The order and load of such a robot are uncertain, so its orders may fail, and a person has to check it.
    The others continue.
    """
    async with trial(seed=15, singles=1) as running:
        site = running.site
        await with_single(running)
        place = await at_an_order(site, SINGLE)
        site.suspects.add(SINGLE)
        site.start_single(SINGLE, at=place, machine="double")
        for machine in ("first", "double"):
            await site.programs[machine].logged("check whether another program uses this client ID")
        await running.at_work(FURTHER)
        site.programs.pop("double").kill()
        await running.recovers("duplicate robot")
        await site.robots_are("ONLINE", SINGLE)
