"""The actions of operations."""

from __future__ import annotations

import pytest

from nena_order_service.fleet.vda_order import OperationMap
from nena_shared.plant import Location
from nena_shared.vda5050.action import BlockingType

STATION = Location(name="Storage", type="Transfer station")


def parameters(
    operation: str, properties: dict[str, str], location: Location | None = STATION
) -> dict[str, object]:
    (action,) = OperationMap().actions(operation, properties, location)
    return {each.key: each.value for each in action.action_parameters}


@pytest.mark.clause("6.2.3")
@pytest.mark.parametrize(
    ("operation", "action_type"),
    [
        ("Load cargo", "pick"),
        ("Load", "pick"),
        ("Unload cargo", "drop"),
        ("Unload", "drop"),
        ("Charge", "startCharging"),
        ("CHARGE", "startCharging"),
        ("weigh", "weigh"),
    ],
)
def test_operations_become_actions(operation: str, action_type: str) -> None:
    (action,) = OperationMap().actions(operation, {}, STATION)
    assert action.action_type == action_type
    assert action.blocking_type is BlockingType.HARD


@pytest.mark.parametrize("operation", ["MOVE", "PARK", "NOP"])
def test_arriving_needs_no_action(operation: str) -> None:
    assert OperationMap().actions(operation, {}, STATION) == ()


@pytest.mark.clause("6.1.1/ids")
def test_each_action_has_an_id_of_its_own() -> None:
    operations = OperationMap()
    ids = {operations.actions("Load", {}, STATION)[0].action_id for _ in range(100)}
    assert len(ids) == 100


@pytest.mark.clause("6.2.3/pick")
def test_pick_names_its_station_and_load() -> None:
    assert parameters("Load", {"loadType": "EPAL", "height": "1.2"}) == {
        "stationType": "Transfer station",
        "stationName": "Storage",
        "loadType": "EPAL",
        "height": "1.2",
    }


@pytest.mark.clause("6.2.3/pick")
def test_fields_required_by_2_1_are_always_present() -> None:
    assert parameters("Unload", {}, None) == {"stationType": "point", "loadType": "unspecified"}


def test_properties_override_the_plant() -> None:
    assert parameters("Load", {"stationName": "shelf 3"})["stationName"] == "shelf 3"


def test_other_actions_get_only_the_properties() -> None:
    assert parameters("weigh", {"unit": "kg"}) == {"unit": "kg"}


def test_settings_come_before_the_defaults() -> None:
    operations = OperationMap({"Load": "scoop", "Charge": ""})
    assert operations.actions("Load", {}, STATION)[0].action_type == "scoop"
    assert operations.actions("Charge", {}, STATION) == ()
    assert operations.actions("Unload", {}, STATION)[0].action_type == "drop"
