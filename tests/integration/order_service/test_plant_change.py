"""The plant model is changed while a robot drives: refused where it is in use, else put in use as a whole."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest
from structlog.testing import capture_logs

from nena_demo.plants import sample_plant_path
from nena_plant_formats.files import read
from nena_plant_formats.opentcs_xml import write
from nena_shared.plant import PlantModel
from support.broker import MqttPeer
from support.order_service_fleet import Fleet, order_in, running, vehicle_idle

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
PLANT = "/v1/plantModel"
SAMPLE = read(sample_plant_path().read_bytes()).model


def with_hall(**changes: Any) -> PlantModel:
    return SAMPLE.model_copy(update={"name": "Hall 2", **changes})


def without(point: str) -> PlantModel:
    """Remove a point, and everything that depends on it."""
    return with_hall(
        points=tuple(each for each in SAMPLE.points if each.name != point),
        paths=tuple(each for each in SAMPLE.paths if point not in (each.source, each.destination)),
    )


async def put(client: httpx.AsyncClient, content: str | bytes, **query: Any) -> httpx.Response:
    return await client.put(PLANT, content=content, params=query)


def actions(wire: MqttPeer, fleet: Fleet) -> set[str]:
    """Return the IDs of all actions in orders to robots."""
    wire.catch_up()
    orders = [json.loads(each.payload) for each in wire.received(f"{fleet.interface}/v2/NeNa/robot-01/order")]
    return {action["actionId"] for order in orders for node in order["nodes"] for action in node["actions"]}


async def test_changed_while_a_robot_drives(fleet: Fleet, service: Start) -> None:
    wire = fleet.peer()
    client = await service()
    fleet.agent("robot-01", x=21.0, y=12.0, speed=4.0)
    await vehicle_idle(client)
    body = {"name": "T-1", "destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}
    assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
    await wire.wait_for(f"{fleet.interface}/v2/NeNa/robot-01/order")

    refused = await put(client, without("Middle 1").to_json())
    assert (refused.status_code, refused.headers["content-type"]) == (409, "application/problem+json")
    errors = refused.json()["errors"]
    assert any("'Robot-01' uses 'Middle 1', which would be removed" in each for each in errors), errors
    assert PlantModel.from_json((await client.get(PLANT)).content) == SAMPLE

    looked_at = await put(client, without("Parking bay").to_json(), check=True)
    assert (looked_at.status_code, looked_at.json()["changed"]) == (200, False)
    assert PlantModel.from_json((await client.get(PLANT)).content) == SAMPLE

    changed = await put(client, without("Parking bay").to_json())
    assert (changed.status_code, changed.json()["changed"], changed.json()["points"]) == (200, True, 19)
    assert PlantModel.from_json((await client.get(PLANT)).content) == without("Parking bay")
    gone = await client.post("/v1/vehicles/Robot-02/dispatch", json={"point": "Parking bay"})
    assert gone.status_code == 404
    told = await wire.wait_for(f"{fleet.prefix}/plantModel", lambda each: b"Hall 2" in each.payload)
    assert PlantModel.from_json(told.payload) == without("Parking bay")
    order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert order["state"] == "FINISHED", order["reason"]
    assert len(actions(wire, fleet)) == 1


async def test_robots_accept_the_orders_after_a_change(fleet: Fleet, service: Start) -> None:
    """Robots refuse an order whose headerId is not greater than that of the last one of the same epoch."""
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    for number in range(3):
        body = {"name": f"T-{number}", "destinations": [{"locationName": f"South {2 + number % 2}"}]}
        assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
        order = await order_in(client, f"T-{number}", "FINISHED", "FAILED")
        assert order["state"] == "FINISHED", order["reason"]
        model = SAMPLE.model_copy(update={"name": f"Hall {number}"})
        assert (await put(client, model.to_json())).status_code == 200


async def test_kept_over_a_restart_until_the_file_changes(fleet: Fleet) -> None:
    async with running(fleet.settings()) as client:
        assert (await put(client, write(with_hall()).data)).json()["name"] == "Hall 2"
    with capture_logs() as logs:
        async with running(fleet.settings()) as client:
            assert (await client.get(PLANT)).json()["name"] == "Hall 2"
    used = [each for each in logs if each["event"] == "using the model activated last, not the file"]
    assert [each["name"] for each in used] == ["Hall 2"]
    file = fleet.folder / "plant.json"
    file.write_text(SAMPLE.model_copy(update={"name": "Hall 3"}).to_json())
    async with running(fleet.settings(plant=file)) as client:
        assert (await client.get(PLANT)).json()["name"] == "Hall 3"
        bad = await put(client, b"<model")
        assert (bad.status_code, bool(bad.json()["errors"])) == (422, True)
        assert (await put(client, b'{"name": "no points", "points": []}')).status_code == 422
        versions = [
            each.model_copy(update={"properties": {"vda5050:version": "9.9"}}) for each in SAMPLE.vehicles
        ]
        spoken = await put(client, with_hall(vehicles=tuple(versions)).to_json())
        assert (spoken.status_code, "9.9" in str(spoken.json()["errors"])) == (422, True)
        assert (await client.get(PLANT)).json()["name"] == "Hall 3"
