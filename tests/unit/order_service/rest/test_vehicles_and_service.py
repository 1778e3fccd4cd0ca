from __future__ import annotations

from typing import Any

import httpx
import pytest

from nena_order_service.parts import OrderService
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant import PlantModel


async def test_vehicles_of_the_plant_are_listed(client: httpx.AsyncClient) -> None:
    found = (await client.get("/v1/vehicles")).json()["vehicles"]
    assert [vehicle["name"] for vehicle in found] == ["Robot-01", "Robot-02"]
    one = VehicleStatus.model_validate((await client.get("/v1/vehicles/Robot-01")).json())
    assert (one.serial_number, one.connection, one.processing_state) == ("robot-01", "UNKNOWN", "IDLE")


@pytest.mark.parametrize(
    ("body", "destination"),
    [
        ({"point": "Middle 1"}, ("Middle 1", "MOVE")),
        ({"point": "Parking bay", "operation": "PARK"}, ("Parking bay", "PARK")),
        ({"locationName": "Packing"}, ("Packing", "NOP")),
        ({"locationName": "Packing", "operation": "Load cargo"}, ("Packing", "Load cargo")),
        ({"coordinate": {"x": 1.5, "y": 2, "theta": 0}}, (None, "MOVE")),
    ],
)
async def test_vehicle_is_dispatched_by_an_order_of_its_own(
    client: httpx.AsyncClient, body: dict[str, Any], destination: tuple[str | None, str]
) -> None:
    answer = await client.post("/v1/vehicles/Robot-02/dispatch", json=body)
    assert answer.status_code == 201
    order = answer.json()
    assert order["intendedVehicle"] == "Robot-02"
    where = order["driveOrders"][0]["destination"]
    assert (where["locationName"], where["operation"]) == destination


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("Robot-09/dispatch", {"point": "Middle 1"}, 404),
        ("Robot-01/dispatch", {"point": "Nowhere"}, 404),
        ("Robot-01/dispatch", {}, 422),
        ("Robot-01/dispatch", {"point": "Middle 1", "locationName": "Packing"}, 422),
        ("Robot-01/dispatch", {"coordinate": {"x": 0, "y": 0, "theta": 7}}, 422),
        ("Robot-09/instantActions", {"actionType": "pause"}, 404),
        ("Robot-01/instantActions", {"actionType": "pause"}, 409),
        ("Robot-01/instantActions", {"actionType": "initializePosition"}, 422),
        ("Robot-01/instantActions", {"actionType": "pause", "pose": {"x": 0, "y": 0, "theta": 0}}, 422),
    ],
)
async def test_bad_requests_to_vehicles(
    client: httpx.AsyncClient, path: str, body: dict[str, Any], status: int
) -> None:
    answer = await client.post(f"/v1/vehicles/{path}", json=body)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    assert (await client.get("/v1/transportOrders")).json()["transportOrders"] == []


async def test_plant_model_is_told_as_it_is(client: httpx.AsyncClient, service: OrderService) -> None:
    answer = await client.get("/v1/plantModel")
    assert PlantModel.from_json(answer.content) == service.kernel.plant


async def test_health_and_readiness(client: httpx.AsyncClient, service: OrderService) -> None:
    assert (await client.get("/healthz")).status_code == 200
    answer = await client.get("/readyz")
    assert answer.status_code == 503
    assert "broker" in answer.json()["problems"][0]
    service.mqtt.state.connected = True
    assert (await client.get("/readyz")).json() == {
        "ready": True,
        "role": "active",
        "brokerConnected": True,
        "storeReady": True,
        "problems": [],
    }
    service.store.problem = "disk full"
    assert "disk full" in (await client.get("/readyz")).json()["problems"][0]


async def test_openapi_describes_every_path(client: httpx.AsyncClient) -> None:
    paths = (await client.get("/openapi.json")).json()["paths"]
    assert {
        "/v1/transportOrders",
        "/v1/transportOrders/{name}",
        "/v1/transportOrders/{name}/withdrawal",
        "/v1/vehicles",
        "/v1/vehicles/{name}",
        "/v1/vehicles/{name}/dispatch",
        "/v1/vehicles/{name}/instantActions",
        "/v1/plantModel",
    } <= set(paths)


async def test_vehicles_are_filtered_and_paged(client: httpx.AsyncClient) -> None:
    async def names(**query: str) -> list[str]:
        answer = await client.get("/v1/vehicles", params=query)
        return [vehicle["name"] for vehicle in answer.json()["vehicles"]]

    assert await names(limit="1") == ["Robot-01"]
    page = (await client.get("/v1/vehicles", params={"limit": "1"})).json()
    assert await names(after=page["next"]) == ["Robot-02"]
    assert (await client.get("/v1/vehicles", params={"after": "Robot-01"})).json()["next"] is None
    assert await names(state="UNKNOWN", processingState="IDLE") == ["Robot-01", "Robot-02"]
    assert await names(state="IDLE") == []
    assert (await client.get("/v1/vehicles", params={"after": "R2D2"})).status_code == 404


async def test_integration_level_is_set_and_told(client: httpx.AsyncClient) -> None:
    place = "/v1/vehicles/Robot-01/integrationLevel"
    answer = await client.put(place, json={"integrationLevel": "TO_BE_RESPECTED"})
    assert (answer.status_code, answer.json()["integrationLevel"]) == (200, "TO_BE_RESPECTED")
    assert answer.json()["reason"] == "has the integration level TO_BE_RESPECTED"
    assert (await client.put(place, json={"integrationLevel": "LATER"})).status_code == 422
    missing = await client.put("/v1/vehicles/R2/integrationLevel", json={"integrationLevel": "TO_BE_IGNORED"})
    assert missing.status_code == 404


async def test_acceptable_order_types_are_set_and_told(client: httpx.AsyncClient) -> None:
    url = "/v1/vehicles/Robot-01/acceptableOrderTypes"
    assert (await client.get("/v1/vehicles/Robot-01")).json()["acceptableOrderTypes"] == [
        {"name": "*", "priority": 0}
    ]
    types = [{"name": "Transport", "priority": 2}, {"name": "Charge", "priority": 1}]
    answer = await client.put(url, json={"acceptableOrderTypes": types})
    assert (answer.status_code, answer.json()["acceptableOrderTypes"]) == (200, types)
    assert (await client.get("/v1/vehicles/Robot-01")).json()["acceptableOrderTypes"] == types
    assert (await client.put(url, json={"acceptableOrderTypes": [types[0], types[0]]})).status_code == 422
    elsewhere = "/v1/vehicles/R2D2/acceptableOrderTypes"
    assert (await client.put(elsewhere, json={"acceptableOrderTypes": []})).status_code == 404
