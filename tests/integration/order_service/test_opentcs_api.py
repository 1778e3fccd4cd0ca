"""Hosts of openTCS change the plant over its web API, and follow its stream."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from itertools import pairwise

import httpx
import pytest

from support.opentcs_routes import FOR_ROBOT, LEVELS

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
API = "/opentcs/v1"


async def test_properties_of_plant_objects_are_changed_and_kept(service: Start) -> None:
    client = await service()
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    vehicle = f"{API}/vehicles/Robot-01"
    levels = {**LEVELS, "energyLevelCritical": 11}
    assert (await client.put(f"{vehicle}/energyLevelThresholdSet", json=levels)).status_code == 200
    named = await client.put(f"{vehicle}/envelopeKey", params={"newValue": "wide"})
    assert named.status_code == 200
    shown = (await client.get(vehicle)).json()
    assert (shown["energyLevelCritical"], shown["envelopeKey"]) == (11, "wide")

    locked = await client.put(f"{API}/locations/Goods in/locked", params={"newValue": "true"})
    assert locked.status_code == 200
    plant = (await client.get(f"{API}/plantModel")).json()
    assert [each["locked"] for each in plant["locations"] if each["name"] == "Goods in"] == [True]

    plant["blocks"] = []
    assert (await client.put(f"{API}/plantModel", json=plant)).status_code == 200
    assert (await client.get(f"{API}/plantModel")).json() == plant
    assert (await client.get("/v1/plantModel")).json()["blocks"] == []
    assert (await client.get(f"{API}/transportOrders/T-1")).json()["state"] == "DISPATCHABLE"

    used = {**plant, "points": [each for each in plant["points"] if each["name"] != "South 2"]}
    used["paths"] = [
        each for each in plant["paths"] if "South 2" not in (each["srcPointName"], each["destPointName"])
    ]
    refused = await client.put(f"{API}/plantModel", json=used)
    assert (refused.status_code, "T-1" in refused.text) == (409, True)


async def test_the_stream_contains_chosen_objects_with_their_previous_state(service: Start) -> None:
    client = await service()
    chosen = {"/events/transportOrders": "true", "/events/orderSequences": "true"}
    async with client.stream("GET", f"{API}/sse", params=chosen) as stream:
        lines = stream.aiter_lines()
        await anext(lines)  # a heartbeat: it has begun
        await client.post(f"{API}/orderSequences/S-1", json={})
        await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
        await client.post(f"{API}/transportOrders/T-1/withdrawal")
        found: list[tuple[str, dict[str, object], dict[str, object] | None]] = []
        async for line in lines:
            if line.startswith("event: /events"):
                topic = line.removeprefix("event: ")
                event = json.loads((await anext(lines)).removeprefix("data: "))
                found.append((topic, event["currentObjectState"], event["previousObjectState"]))
                if event["currentObjectState"].get("state") == "FAILED":
                    break
    sequence, *orders = found
    assert (sequence[0], sequence[1]["name"], sequence[2]) == ("/events/orderSequences", "S-1", None)
    assert {topic for topic, *_ in orders} == {"/events/transportOrders"}
    assert orders[0][2] is None
    for (_, earlier, _), (_, _, before) in pairwise(orders):
        assert before == earlier
    assert orders[-1][1]["driveOrders"] == [
        {
            "name": "T-1-0",
            "destination": {"destination": "South 2", "operation": "MOVE", "properties": {}},
            "transportOrder": "T-1",
            "route": None,
            "state": "FAILED",
        }
    ]
