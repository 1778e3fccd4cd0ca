"""Transport orders over both doors, done by loopback robots over a real broker."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import httpx
import pytest

from nena_shared.fleet_api.transport_order import CreationAnswer, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant import PlantModel
from support.broker import Broker
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited, until

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]

TRANSPORT = {
    "name": "T-1",
    "destinations": [
        {"locationName": "Goods in", "operation": "Load cargo"},
        {"locationName": "Storage", "operation": "Unload cargo"},
    ],
}


async def test_order_over_rest_is_executed(fleet: Fleet, service: Start) -> None:
    wire = fleet.peer(f"{fleet.interface}/v2/+/+/order")
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    assert (await client.post("/v1/transportOrders", json=TRANSPORT)).status_code == 201

    order = TransportOrderStatus.model_validate(await order_in(client, "T-1", "FINISHED", "FAILED"))

    assert order.state == "FINISHED", order.reason
    assert order.processing_vehicle == "Robot-01"
    assert [each.state for each in order.drive_orders] == ["FINISHED", "FINISHED"]
    assert order.drive_orders[0].route == ("South 1", "Goods in stand")
    assert [
        entry.event_code.split(":")[1] for entry in order.history if "Deferred" not in entry.event_code
    ] == [
        "orderCreated",
        "assignedToVehicle",
        "operationStarted",
        "driveOrderFinished",
        "operationStarted",
        "driveOrderFinished",
        "finalStateReached",
    ]
    wire.catch_up()
    sent = [json.loads(message.payload) for message in wire.received()]
    assert list(dict.fromkeys(each["orderId"] for each in sent)) == ["T-1-0", "T-1-1"]
    vehicle = await vehicle_idle(client)
    assert vehicle["processingState"] == "IDLE"
    assert vehicle["transportOrder"] is None
    assert vehicle["currentPosition"].startswith("Storage")


async def test_a_reconnecting_host_finds_the_final_status_at_the_broker(fleet: Fleet, service: Start) -> None:
    client = await service(end_kept=60)
    await client.post("/v1/transportOrders", json=TRANSPORT)
    topic = f"{fleet.prefix}/transportOrders/T-1/status"
    before = fleet.peer(topic)
    await client.post("/v1/transportOrders/T-1/withdrawal")
    await before.wait_for(topic, lambda each: b"FAILED" in each.payload)

    found = await fleet.peer(topic).wait_for(topic)
    assert found.retained
    assert TransportOrderStatus.model_validate_json(found.payload).state == "FAILED"


async def test_order_over_mqtt_is_answered_published_and_cleared(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    host = fleet.peer(f"{fleet.prefix}/#")
    host.publish(f"{fleet.prefix}/hosts/wms/transportOrders/create", json.dumps(TRANSPORT))

    message = await host.wait_for(f"{fleet.prefix}/hosts/wms/transportOrders/answer")
    answer = CreationAnswer.model_validate_json(message.payload)
    assert (answer.status, answer.name) == (201, "T-1")
    topic = f"{fleet.prefix}/transportOrders/T-1/status"
    await host.wait_for(topic, lambda each: each.payload == b"")

    told = [TransportOrderStatus.model_validate_json(each) for each in host.payloads(topic) if each]
    versions = [each.version for each in told]
    assert versions == sorted(set(versions))
    assert [each.state for each in told][-1] == "FINISHED"
    assert {"DISPATCHABLE", "BEING_PROCESSED"} >= {each.state for each in told[:-1]}
    vehicles = [
        VehicleStatus.model_validate_json(each)
        for each in host.payloads(f"{fleet.prefix}/vehicles/robot-01/status")
    ]
    assert "T-1" in {each.transport_order for each in vehicles}
    late = fleet.peer(f"{fleet.prefix}/#")
    plant = await late.wait_for(f"{fleet.prefix}/plantModel")
    assert PlantModel.from_json(plant.payload).name == "Sample hall"
    assert late.payloads(topic) == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"{", 400),
        (b'{"destinations": []}', 422),
        (b'{"destinations": [{"locationName": "Nowhere"}]}', 404),
        (b'{"name": "T", "idempotencyKey": "k", "colour": "red"}', 422),
        (b" " * 300_000, 413),
    ],
)
async def test_bad_requests_over_mqtt_are_answered(
    fleet: Fleet, service: Start, body: bytes, status: int
) -> None:
    client = await service()
    host = fleet.peer(f"{fleet.prefix}/hosts/+/transportOrders/answer")
    await awaited(
        lambda: client.get("/readyz"),
        lambda got: got.status_code == 200,
        seconds=PATIENCE,
        what="it is ready",
    )
    host.publish(f"{fleet.prefix}/hosts/plc-7/transportOrders/create", body)
    message = await host.wait_for(f"{fleet.prefix}/hosts/plc-7/transportOrders/answer")
    answer = CreationAnswer.model_validate_json(message.payload)
    assert answer.status == status
    assert answer.problem is not None
    assert answer.problem.detail.endswith(".")
    assert (answer.name, answer.idempotency_key) == (("T", "k") if b'"T"' in body else (None, None))
    assert (await client.get("/v1/transportOrders")).json()["transportOrders"] == []


async def test_retained_request_is_refused_and_same_key_creates_one_order(
    fleet: Fleet, service: Start
) -> None:
    host = fleet.peer(f"{fleet.prefix}/hosts/+/transportOrders/answer")
    create = f"{fleet.prefix}/hosts/wms/transportOrders/create"
    host.publish(create, json.dumps(TRANSPORT), retain=True)
    client = await service()
    refused = CreationAnswer.model_validate_json((await host.wait_for()).payload)
    assert refused.status == 400
    host.publish(create, b"", retain=True)
    host.clear()

    body = json.dumps({**TRANSPORT, "idempotencyKey": "k"})
    for _ in range(10):
        host.publish(create, body)
    answers = await until(lambda: got if len(got := host.payloads()) == 10 else None)
    made = [CreationAnswer.model_validate_json(each) for each in answers]
    assert sorted(each.status for each in made) == [200] * 9 + [201]

    for other, status in (({"idempotencyKey": "k", "priority": 3}, 422), ({"priority": 3}, 409)):
        host.clear()
        host.publish(create, json.dumps({**TRANSPORT, **other}))
        refused = CreationAnswer.model_validate_json((await host.wait_for()).payload)
        assert (refused.status, refused.idempotency_key) == (status, other.get("idempotencyKey"))
        assert refused.problem is not None
        assert "'T-1'" in refused.problem.detail
    assert len((await client.get("/v1/transportOrders")).json()["transportOrders"]) == 1


async def test_an_infeasible_drive_fails_the_order_with_a_reason(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    twice = {"name": "T-1", "destinations": [TRANSPORT["destinations"][0]] * 2}
    await client.post("/v1/transportOrders", json=twice)
    order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert order["state"] == "FAILED"
    assert [each["state"] for each in order["driveOrders"]] == ["FINISHED", "FAILED"]
    assert order["history"][-1]["supplements"][1] == order["reason"]
    await vehicle_idle(client)
    await client.post("/v1/vehicles/Robot-01/dispatch", json={"point": "South 2"})


async def test_withdrawn_order_ends_when_the_robot_has_released_it(fleet: Fleet, service: Start) -> None:
    wire = fleet.peer(f"{fleet.interface}/v2/#")
    client = await service()
    fleet.agent(speed=0.5)
    await vehicle_idle(client)
    await client.post("/v1/transportOrders", json=TRANSPORT)
    await wire.wait_for(f"{fleet.interface}/v2/+/+/order")
    answer = (await client.post("/v1/transportOrders/T-1/withdrawal")).json()
    assert answer["state"] == "WITHDRAWN"
    order = await order_in(client, "T-1", "FAILED")
    assert "withdrawn" in order["reason"]
    await wire.wait_for(
        f"{fleet.interface}/v2/+/+/instantActions", lambda message: b"cancelOrder" in message.payload
    )
    vehicle = await vehicle_idle(client)
    assert vehicle["transportOrder"] is None


async def test_vehicle_drives_to_a_coordinate_and_continues_from_there(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent()
    await vehicle_idle(client)
    goal = {"x": 5.5, "y": 4.5, "theta": 1.0}
    made = await client.post("/v1/vehicles/Robot-01/dispatch", json={"coordinate": goal})
    order = await order_in(client, made.json()["name"], "FINISHED", "FAILED")
    assert order["state"] == "FINISHED", order["reason"]
    position = (await client.get("/v1/vehicles/Robot-01")).json()["precisePosition"]
    assert [position[key] for key in ("x", "y", "theta")] == pytest.approx([5.5, 4.5, 1.0], abs=0.35)

    made = await client.post("/v1/vehicles/Robot-01/dispatch", json={"point": "South 2"})
    order = await order_in(client, made.json()["name"], "FINISHED", "FAILED")
    assert order["state"] == "FINISHED", order["reason"]


async def test_instant_actions_are_tracked_to_their_end(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent()
    await vehicle_idle(client)

    async def act(**body: Any) -> dict[str, Any]:
        answer = await client.post("/v1/vehicles/Robot-01/instantActions", json=body)
        assert answer.status_code == 200, answer.text
        done: dict[str, Any] = answer.json()
        return done

    for kind in ("pause", "resume"):
        done = await act(actionType=kind)
        assert done["status"] == "FINISHED", done
    pose = {"x": 9, "y": 7, "theta": 0}
    done = await act(actionType="initializePosition", pose=pose)
    assert done["status"] == "FINISHED", done
    unknown = await act(actionType="sing", parameters=[{"key": "song", "value": "any"}])
    assert unknown["status"] in ("FAILED", "UNKNOWN")
    assert unknown["reason"]

    async def position() -> str | None:
        found: str | None = (await client.get("/v1/vehicles/Robot-01")).json()["currentPosition"]
        return found

    await awaited(position, lambda point: point == "Middle 2", seconds=PATIENCE, what="it is at Middle 2")


async def test_robot_outside_the_plant_is_listed_without_orders(fleet: Fleet, service: Start) -> None:
    client = await service()
    fleet.agent("stranger")
    await vehicle_idle(client, "stranger")
    stranger = (await client.get("/v1/vehicles/stranger")).json()
    assert stranger["reason"] == "is not in the plant model"
    order = (await client.post("/v1/transportOrders", json=TRANSPORT)).json()
    assert order["state"] == "DISPATCHABLE"
    assert (await client.post("/v1/vehicles/stranger/dispatch", json={"point": "South 2"})).status_code == 404


async def test_robot_outside_the_plant_is_adopted_if_configured(fleet: Fleet, service: Start) -> None:
    client = await service(engine={"adopt_unknown": True})
    fleet.agent("stranger")
    await vehicle_idle(client, "stranger")
    await client.post("/v1/transportOrders", json=TRANSPORT)
    order = await order_in(client, "T-1", "FINISHED", "FAILED")
    assert (order["state"], order["processingVehicle"]) == ("FINISHED", "stranger")


async def test_orders_wait_while_the_broker_is_unavailable(
    fleet: Fleet, service: Start, own_broker: Broker
) -> None:
    fleet.broker = own_broker
    own_broker.kill()
    client = await service()
    assert (await client.get("/readyz")).status_code == 503
    order = (await client.post("/v1/transportOrders", json=TRANSPORT)).json()
    assert order["state"] == "DISPATCHABLE"
    assert "broker" in order["reason"]
    own_broker.start()
    fleet.agent()
    assert (await order_in(client, "T-1", "FINISHED", "FAILED"))["state"] == "FINISHED"
    assert (await client.get("/readyz")).status_code == 200


async def test_most_urgent_order_is_executed_first(fleet: Fleet, service: Start) -> None:
    client = await service()
    for name, priority in (("low", 0), ("high", 5), ("middle", 1)):
        body = {"name": name, "priority": priority, "destinations": [{"locationName": "South 2"}]}
        await client.post("/v1/transportOrders", json=body)
    fleet.agent()
    ended = await asyncio.gather(*(order_in(client, name, "FINISHED") for name in ("high", "middle", "low")))
    times = [order["finished"] for order in ended]
    assert times == sorted(times)
