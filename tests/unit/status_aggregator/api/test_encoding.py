"""Large responses are encoded in slices, so that other tasks are not delayed."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator

import httpx
import pytest

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.encoding import SLICE, encode, encode_list
from support.fleet_records import state
from support.pausing import turn_passes


@pytest.mark.parametrize("number", [0, 1, SLICE, SLICE + 1, 3 * SLICE])
async def test_a_view_is_the_same_in_slices(number: int) -> None:
    robots = [{"id": str(each), "x": None} for each in range(number)]
    view = {"id": 1, "robots": robots, "plant": None, "link": {"up": True}}
    assert json.loads(await encode(view)) == view
    assert json.loads(await encode({**view, "robots": iter(robots)})) == view
    assert json.loads(await encode_list(robots)) == robots


async def test_other_tasks_run_between_slices() -> None:
    most = now = 0

    async def count_turns() -> None:
        nonlocal now
        while True:
            now = 0
            await turn_passes()

    def views() -> Iterator[dict[str, int]]:
        nonlocal most, now
        for each in range(10 * SLICE):
            now += 1
            most = max(most, now)
            yield {"id": each}

    counting = asyncio.create_task(count_turns())
    await encode({"robots": views()})
    counting.cancel()
    assert most == SLICE


async def test_a_large_fleet_is_listed_whole(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    for number in range(2 * SLICE + 1):
        key = RobotKey("ACME", f"r{number}")
        aggregator.model.on_state(key, state(robot=key), aggregator.now())
    shown = (await client.get("/api/v1/fleet")).json()
    assert len({each["id"] for each in shown["robots"]}) >= 2 * SLICE + 1
    assert all("stateAge" in each for each in shown["robots"])
