"""Numbers in another unit than the standard's are told, and used as they are."""

from __future__ import annotations

import json
from typing import Any

import pytest

from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.state import State
from nena_shared.vda5050.versions import CODECS, codec_for
from support.fleet_examples import factsheet, state


def read(version: str, message: Factsheet | State, **fields: Any) -> list[str]:
    codec, told = codec_for(version), list[Repair]()
    content = json.loads(codec.encode(message))
    for name, inner in fields.items():
        if name in content:
            content[name] |= inner
    reader = MessageReader(lambda _, repairs: told.extend(repairs))
    for _ in range(3):
        kind = Factsheet if isinstance(message, Factsheet) else State
        reader.read(kind, "a/b", json.dumps(content).encode(), codec.major_version)
    return [str(each) for each in told]


@pytest.mark.parametrize("version", CODECS)
def test_sizes_and_speeds_in_mm_are_told_once(version: str) -> None:
    assert read(version, factsheet(), physicalParameters={"length": 4.9, "width": 2.0}) == []
    fast = "maximumSpeed" if version.startswith("3.") else "speedMax"
    assert read(version, factsheet(), physicalParameters={"length": 1100.0, "width": 700, fast: 1500.0}) == [
        f"physicalParameters.{fast} 1500 (mm/s?): unit in doubt",
        "physicalParameters.width 700 (mm?): unit in doubt",
        "physicalParameters.length 1100 (mm?): unit in doubt",
    ]


def test_all_lengths_of_a_factsheet_count() -> None:
    wheel = {
        "type": "DRIVE",
        "isActiveDriven": True,
        "isActiveSteered": False,
        "diameter": 200.0,
        "width": 80,
    }
    wheel |= {"position": {"x": 300.0, "y": -250.0}}
    box = {"loadDimensions": {"length": 1200.0, "width": 800.0, "height": 1.0}, "agvSpeedLimit": 900.0}
    told = read(
        "2.1.0",
        factsheet(),
        agvGeometry={"wheelDefinitions": [wheel, wheel]},
        loadSpecification={"loadSets": [{"setName": "s", "loadType": "EPAL", **box}]},
        protocolLimits={"maxStringLens": {"msgLen": 10000}},
    )
    fields = {each.partition(" ")[0] for each in told}
    assert fields == {
        "agvGeometry.wheelDefinitions.diameter",
        "agvGeometry.wheelDefinitions.width",
        "agvGeometry.wheelDefinitions.position.x",
        "agvGeometry.wheelDefinitions.position.y",
        "loadSpecification.loadSets.loadDimensions.length",
        "loadSpecification.loadSets.loadDimensions.width",
        "loadSpecification.loadSets.agvSpeedLimit",
    }


@pytest.mark.parametrize("version", CODECS)
@pytest.mark.parametrize(
    ("charge", "told"), [(0.85, True), (1.0, True), (0.0, False), (1.5, False), (80.0, False)]
)
def test_a_charge_that_may_be_a_fraction_is_told_once(version: str, charge: float, *, told: bool) -> None:
    fields = {"batteryState": {"batteryCharge": charge}, "powerSupply": {"stateOfCharge": charge}}
    of_3 = version.startswith("3.")
    field = "powerSupply.stateOfCharge" if of_3 else "batteryState.batteryCharge"
    assert read(version, state(), **fields) == [f"{field} {charge:g} (a fraction?): unit in doubt"] * told
