from __future__ import annotations

from typing import Any

import httpx
import pytest


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
async def test_vehicle_is_dispatched_with_its_own_order(
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
