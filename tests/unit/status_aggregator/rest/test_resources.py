from __future__ import annotations

import httpx
import pytest

from nena_shared.clock import ManualClock
from nena_shared.plant.model import PlantModel
from nena_status_aggregator.aggregator import Aggregator
from support.fleet_examples import sample_plant


async def test_an_empty_fleet(client: httpx.AsyncClient) -> None:
    fleet = (await client.get("/api/v1/fleet")).json()
    assert fleet["robots"] == fleet["orders"] == []
    assert fleet["plant"] is None
    assert fleet["link"] == {"connected": False, "since": None}


@pytest.mark.usefixtures("populated")
async def test_the_fleet_with_the_age_of_states(client: httpx.AsyncClient, clock: ManualClock) -> None:
    clock.advance(7.5)
    fleet = (await client.get("/api/v1/fleet")).json()
    assert fleet["time"] == "2026-01-01T00:00:07.500Z"
    assert [(each["id"], each["stateAge"]) for each in fleet["robots"]] == [("ACME/r1", 7.5)]
    assert [each["id"] for each in fleet["orders"]] == ["TO-1"]
    assert fleet["link"]["connected"] is True


@pytest.mark.usefixtures("populated")
async def test_orders(client: httpx.AsyncClient) -> None:
    orders = (await client.get("/api/v1/orders")).json()
    assert [(each["id"], each["state"]) for each in orders] == [("TO-1", "BEING_PROCESSED")]
    assert orders[0]["destinations"][0] == {
        "place": "Goods in",
        "operation": "Load",
        "state": "TRAVELLING",
    }


async def test_the_plant_as_it_was_published(client: httpx.AsyncClient, aggregator: Aggregator) -> None:
    plant = sample_plant()
    aggregator.model.on_plant_model(plant)
    answer = await client.get("/api/v1/plant")
    assert PlantModel.from_json(answer.content) == plant
