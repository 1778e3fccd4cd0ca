"""Programs are killed in mid-work, and started again: each goes on where it was."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import httpx
import pytest

from faults.extent import TIMES, only_in_whole
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(900)]


@pytest.mark.long
async def test_order_service_killed(trial: Callable[..., Any]) -> None:
    async with trial(seed=2) as running:
        for _ in range(2 * TIMES):
            running.site.programs["order-service"].kill()
            running.site.start_order_service()
            await running.recovers("order service killed")


@only_in_whole
async def test_robots_killed(trial: Callable[..., Any]) -> None:
    """Kill all loopback robots at once: they keep their positions, and continue their orders."""
    async with trial(seed=3) as running:
        for _ in range(TIMES):
            running.site.programs["loopback"].kill()
            running.site.start_loopback()
            await running.recovers("robots killed")


@only_in_whole
async def test_aggregator_killed(trial: Callable[..., Any]) -> None:
    """Kill the aggregator: no other program waits for it, and afterwards it has the fleet again."""
    async with trial(seed=4) as running:
        for _ in range(TIMES):
            running.site.programs["aggregator"].kill()
            await running.recovers("aggregator killed")
            running.site.start_aggregator()
            async with httpx.AsyncClient(base_url=running.site.aggregator_url, timeout=60) as client:

                async def seen(client: httpx.AsyncClient = client) -> set[str]:
                    try:
                        fleet = (await client.get("/api/v1/fleet")).json()
                    except (httpx.HTTPError, ValueError):
                        return set()
                    return {each["serialNumber"] for each in fleet["robots"]}

                serials = set(running.site.serials)
                await awaited(seen, serials.issubset, seconds=60, what="the aggregator knows every robot")


@pytest.mark.long
async def test_agents_on_ros_killed(trial: Callable[..., Any]) -> None:
    """Kill the agents of ten robots, two of them on ROS, while they drive: they continue their goals."""
    async with trial(on_ros=True, seed=5) as running:
        for _ in range(TIMES):
            for number in (1, 2):
                running.site.programs[f"ros-{number}"].kill()
                running.site.start_ros_agent(number)
            await running.recovers("agents on ROS killed")
