from __future__ import annotations

import httpx

from nena_shared.fleet_api.vehicle import VehicleStatus


async def test_vehicles_of_the_plant_are_listed(client: httpx.AsyncClient) -> None:
    found = (await client.get("/v1/vehicles")).json()["vehicles"]
    assert [vehicle["name"] for vehicle in found] == ["Robot-01", "Robot-02"]
    one = VehicleStatus.model_validate((await client.get("/v1/vehicles/Robot-01")).json())
    assert (one.serial_number, one.connection, one.processing_state) == ("robot-01", "UNKNOWN", "IDLE")


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


async def test_integration_level_is_set_and_published(client: httpx.AsyncClient) -> None:
    place = "/v1/vehicles/Robot-01/integrationLevel"
    answer = await client.put(place, json={"integrationLevel": "TO_BE_RESPECTED"})
    assert (answer.status_code, answer.json()["integrationLevel"]) == (200, "TO_BE_RESPECTED")
    assert answer.json()["reason"] == "is set to “Out of use”"
    assert answer.json()["levelSet"]["by"] == "somebody"
    named = await client.put(place, json={"integrationLevel": "TO_BE_NOTICED", "by": "Anna"})
    assert named.json()["levelSet"]["by"] == "Anna"
    used = await client.put(place, json={"integrationLevel": "TO_BE_UTILIZED", "by": "Anna"})
    assert used.json()["levelSet"] is None
    assert (await client.put(place, json={"integrationLevel": "LATER"})).status_code == 422
    missing = await client.put("/v1/vehicles/R2/integrationLevel", json={"integrationLevel": "TO_BE_IGNORED"})
    assert missing.status_code == 404


async def test_acceptable_order_types_are_set_and_published(client: httpx.AsyncClient) -> None:
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
