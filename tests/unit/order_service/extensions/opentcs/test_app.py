"""openTCS's web API as a client of it calls it."""

from __future__ import annotations

from typing import Any

import httpx
import pytest
from pydantic import ValidationError

from nena_order_service.api.server import accept_access_key
from nena_order_service.extensions.opentcs import OpenTcsSettings
from nena_order_service.service import OrderService

API = "/opentcs/v1"
BODY: dict[str, Any] = {
    "deadline": "2035-01-01T00:00:00Z",
    "intendedVehicle": "Robot-01",
    "destinations": [
        {
            "locationName": "Goods in",
            "operation": "Load cargo",
            "properties": [{"key": "a", "value": "b"}],
        },
        {"locationName": "South 2", "operation": "MOVE"},
    ],
    "properties": [{"key": "pallet", "value": "4711"}],
    "dependencies": [],
    "wrappingSequence": None,
    "dispensable": True,
    "peripheralReservationToken": "door",
}


async def test_order_is_created_shown_and_listed(client: httpx.AsyncClient) -> None:
    made = await client.post(f"{API}/transportOrders/T-1", json=BODY)
    assert made.status_code == 200
    order = made.json()
    assert (order["name"], order["state"], order["type"]) == ("T-1", "DISPATCHABLE", "-")
    assert (order["intendedVehicle"], order["processingVehicle"]) == ("Robot-01", None)
    assert order["deadline"] == "2035-01-01T00:00:00.000Z"
    assert order["destinations"][0] == {**BODY["destinations"][0], "state": "PRISTINE"}
    assert order["properties"] == BODY["properties"]
    assert (order["dispensable"], order["peripheralReservationToken"]) == (True, "door")
    assert (await client.get(f"{API}/transportOrders/T-1")).json() == order
    assert (await client.get(f"{API}/transportOrders")).json() == [order]
    none = await client.get(f"{API}/transportOrders", params={"intendedVehicle": "Robot-02"})
    assert none.json() == []


async def test_incomplete_name_is_completed(client: httpx.AsyncClient) -> None:
    made = await client.post(f"{API}/transportOrders/Night-", json={**BODY, "incompleteName": True})
    assert made.json()["name"].startswith("Night-")
    assert made.json()["name"] != "Night-"


async def test_creation_errors_are_a_list_of_sentences(client: httpx.AsyncClient) -> None:
    await client.post(f"{API}/transportOrders/T-1", json=BODY)
    refused: list[tuple[str, dict[str, Any], int, str]] = [
        ("T-1", {}, 409, "'T-1'"),
        ("T-2", {"destinations": []}, 400, "destinations"),
        ("T-2", {"destinations": [{"locationName": "Nowhere", "operation": "NOP"}]}, 404, "Nowhere"),
        ("T-2", {"destinations": [{"locationName": "Goods in", "operation": "Fly"}]}, 400, "Fly"),
        ("T-2", {"dependencies": ["T-0"]}, 404, "'T-0'"),
        ("T-2", {"wrappingSequence": "S"}, 404, "'S'"),
        ("T 2", {}, 400, "name"),
    ]
    for name, change, status, problem in refused:
        answer = await client.post(f"{API}/transportOrders/{name}", json={**BODY, **change})
        assert answer.status_code == status, (name, change)
        assert any(problem in sentence for sentence in answer.json())


async def test_withdrawal_of_an_order_and_of_a_vehicle(client: httpx.AsyncClient) -> None:
    await client.post(f"{API}/transportOrders/T-1", json=BODY)
    done = await client.post(f"{API}/transportOrders/T-1/withdrawal", params={"immediate": "true"})
    assert (done.status_code, done.content) == (200, b"")
    assert (await client.get(f"{API}/transportOrders/T-1")).json()["state"] == "FAILED"
    assert (await client.post(f"{API}/transportOrders/T-9/withdrawal")).status_code == 404
    assert (await client.post(f"{API}/vehicles/Robot-01/withdrawal")).status_code == 200
    assert (await client.post(f"{API}/vehicles/R2D2/withdrawal")).status_code == 404


async def test_vehicles_are_shown_as_the_plant_model_has_them(client: httpx.AsyncClient) -> None:
    vehicles = (await client.get(f"{API}/vehicles")).json()
    assert [vehicle["name"] for vehicle in vehicles] == ["Robot-01", "Robot-02"]
    one = (await client.get(f"{API}/vehicles/Robot-01")).json()
    assert one == vehicles[0]
    assert (one["state"], one["procState"], one["transportOrder"]) == ("UNKNOWN", "IDLE", None)
    assert set(one["boundingBox"]) == {"length", "width", "height", "referenceOffset"}
    assert one["properties"]["vda5050:serialNumber"] == "robot-01"
    assert (await client.get(f"{API}/vehicles", params={"procState": "PROCESSING_ORDER"})).json() == []
    assert (await client.get(f"{API}/vehicles", params={"procState": "DANCING"})).status_code == 400
    assert (await client.get(f"{API}/vehicles/R2D2")).status_code == 404


async def test_paths_are_locked_and_the_dispatcher_is_triggered(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    path = service.engine.plant.paths[0].name
    for value in (True, False):
        url = f"{API}/paths/{path}/locked"
        assert (await client.put(url, params={"newValue": str(value).lower()})).status_code == 200
        assert service.hosts.locks.get(path).locked is value
    assert (await client.put(f"{API}/paths/{path}/locked")).status_code == 400
    for url in (f"{API}/dispatcher/trigger", f"{API}/transportOrders/dispatcher/trigger"):
        assert (await client.post(url)).status_code == 200


async def test_unreachable_robot_cannot_be_paused(client: httpx.AsyncClient) -> None:
    answer = await client.put(f"{API}/vehicles/Robot-01/paused", params={"newValue": "true"})
    assert answer.status_code == 409
    assert "Robot-01" in answer.json()[0]


async def test_unknown_routes_and_objects_get_the_same_problem_format(client: httpx.AsyncClient) -> None:
    answer = await client.get(f"{API}/users")
    assert (answer.status_code, answer.json()) == (404, ["Not Found"])
    answer = await client.get(f"{API}/transportOrders/a%0Ab")  # a name may contain a line end
    assert answer.status_code == 404
    assert isinstance(answer.json(), list)
    assert len(answer.json()) == 1


async def test_faults_reveal_no_internals(client: httpx.AsyncClient, failing_create: str) -> None:
    answer = await client.post(f"{API}/transportOrders/T-1", json=BODY)
    assert answer.status_code == 500
    assert failing_create not in answer.text


@pytest.mark.parametrize("prefix", ["/v1", "/v1/x", "opentcs", "/a//b"])
def test_prefix_must_be_a_path_of_its_own(prefix: str) -> None:
    with pytest.raises(ValidationError, match="opentcs_prefix"):
        OpenTcsSettings(opentcs_prefix=prefix)


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({"X-Api-Access-Key": "k"}, "Bearer k"),
        ({"X-Api-Access-Key": "k", "Authorization": "Bearer t"}, "Bearer t"),
        ({}, None),
    ],
)
def test_key_is_taken_for_the_token(headers: dict[str, str], expected: str | None) -> None:
    scope = {"headers": [(name.lower().encode(), value.encode()) for name, value in headers.items()]}
    accept_access_key(scope)
    given = [value.decode() for name, value in scope["headers"] if name == b"authorization"]
    assert given == ([expected] if expected else [])


async def test_acceptable_order_types_are_set_by_both_words(client: httpx.AsyncClient) -> None:
    url = f"{API}/vehicles/Robot-01"
    types = [{"name": "Transport", "priority": 2}]
    assert (
        await client.put(f"{url}/acceptableOrderTypes", json={"acceptableOrderTypes": types})
    ).status_code == 200
    assert (await client.get(url)).json()["acceptableOrderTypes"] == types
    assert (await client.put(f"{url}/allowedOrderTypes", json={"orderTypes": ["A", "*"]})).status_code == 200
    assert (await client.get(url)).json()["allowedOrderTypes"] == ["A", "*"]
    assert (await client.put(f"{url}/allowedOrderTypes", json={})).status_code == 400


async def test_a_vehicle_without_an_order_is_not_rerouted(client: httpx.AsyncClient) -> None:
    answer = await client.post(f"{API}/vehicles/Robot-01/rerouteRequest", params={"forced": True})
    assert (answer.status_code, answer.content) == (200, b"")
