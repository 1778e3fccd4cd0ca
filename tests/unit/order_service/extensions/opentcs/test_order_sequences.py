"""Order sequences over openTCS's web API."""

from __future__ import annotations

import httpx

API = "/opentcs/v1"
ORDER = {"destinations": [{"locationName": "South 2", "operation": "MOVE"}]}


async def test_a_sequence_passes_through_its_life_cycle(client: httpx.AsyncClient) -> None:
    body = {
        "type": "Transport",
        "intendedVehicle": "Robot-01",
        "failureFatal": True,
        "properties": [{"key": "a", "value": "b"}],
    }
    made = await client.post(f"{API}/orderSequences/S", json=body)
    assert made.status_code == 200
    assert made.json().pop("creationTime")
    assert {name: value for name, value in made.json().items() if not name.endswith("Time")} == {
        **body,
        "name": "S",
        "orderTypes": ["Transport"],
        "orders": [],
        "finishedIndex": -1,
        "complete": False,
        "finished": False,
        "processingVehicle": None,
    }
    assert (await client.post(f"{API}/orderSequences/S", json=body)).status_code == 409
    order = {**ORDER, "type": "Transport", "wrappingSequence": "S", "intendedVehicle": "Robot-01"}
    first = (await client.post(f"{API}/transportOrders/T-1", json=order)).json()
    assert (first["wrappingSequence"], first["state"]) == ("S", "DISPATCHABLE")
    other = {**ORDER, "type": "Charge", "wrappingSequence": "S"}
    refused = await client.post(f"{API}/transportOrders/T-2", json=other)
    assert (refused.status_code, "'Charge'" in refused.json()[0]) == (409, True)

    assert (await client.put(f"{API}/orderSequences/S/complete")).status_code == 200
    told = (await client.get(f"{API}/orderSequences/S")).json()
    assert (told["complete"], told["orders"]) == (True, ["T-1"])
    assert (await client.get(f"{API}/orderSequences")).json() == [told]
    none = await client.get(f"{API}/orderSequences", params={"intendedVehicle": "Robot-02"})
    assert none.json() == []


async def test_without_a_type_it_takes_any_order(client: httpx.AsyncClient) -> None:
    made = await client.post(f"{API}/orderSequences/S", json={"incompleteName": True})
    assert made.json()["name"].startswith("S-")
    assert made.json()["orderTypes"] == ["*"]
    assert (await client.post(f"{API}/orderSequences/S", json={"orderTypes": ["A", "B"]})).status_code == 200


async def test_unknown_and_invalid_input_is_described_in_sentences(client: httpx.AsyncClient) -> None:
    assert (await client.get(f"{API}/orderSequences/S")).status_code == 404
    assert (await client.put(f"{API}/orderSequences/S/complete")).status_code == 404
    for name, body, status in (("a b", {}, 400), ("S", {"intendedVehicle": "R2D2"}, 404)):
        answer = await client.post(f"{API}/orderSequences/{name}", json=body)
        assert (answer.status_code, isinstance(answer.json()[0], str)) == (status, True)


async def test_dependencies_are_published(client: httpx.AsyncClient) -> None:
    await client.post(f"{API}/transportOrders/T-1", json=ORDER)
    made = await client.post(f"{API}/transportOrders/T-2", json={**ORDER, "dependencies": ["T-1"]})
    assert (made.json()["state"], made.json()["dependencies"]) == ("ACTIVE", ["T-1"])
