"""Vehicles are addressed by any name that a plant model may have."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.plant_file import load_plant
from nena_order_service.settings import OrderServiceSettings
from nena_shared.plant import Vehicle

NAMES = ["A/B", "/", "rot & blau/1?", "A/B/integrationLevel"]


@pytest.fixture
def settings(settings: OrderServiceSettings, tmp_path: Path) -> OrderServiceSettings:
    vehicles = tuple(
        Vehicle(name=name, properties={"vda5050:serialNumber": f"r{index}"})
        for index, name in enumerate(NAMES)
    )
    model = load_plant(sample_plant_path()).model.model_copy(update={"vehicles": vehicles})
    plant = tmp_path / "plant.json"
    plant.write_text(model.to_json())
    return settings.model_copy(update={"plant": plant})


async def test_names_with_slashes_are_those_of_vehicles(client: httpx.AsyncClient) -> None:
    for name in NAMES:
        place = f"/v1/vehicles/{quote(name, safe='')}"
        for prefix in ("", "/opentcs"):
            assert (await client.get(prefix + place)).json()["name"] == name
        level = {"integrationLevel": "TO_BE_RESPECTED"}
        assert (await client.put(f"{place}/integrationLevel", json=level)).json()["name"] == name
        types = {"acceptableOrderTypes": [{"name": "x", "priority": 1}]}
        assert (await client.put(f"{place}/acceptableOrderTypes", json=types)).json()["name"] == name
        own = f"/opentcs{place}"
        query = {"newValue": "TO_BE_UTILIZED"}
        assert (await client.put(f"{own}/integrationLevel", params=query)).status_code == 200
        assert (await client.get(f"{own}/commAdapter/attachmentInformation")).json()["vehicleName"] == name
        assert (await client.post(f"{own}/withdrawal")).status_code == 200
