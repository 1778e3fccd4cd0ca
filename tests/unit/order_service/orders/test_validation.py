from __future__ import annotations

from typing import Any

import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.orders.validation import (
    InvalidRequestError,
    check_order,
    check_request,
    set_operations,
)
from nena_plant_formats.opentcs_xml import read
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.plant import Location, PlantModel
from support.order_service import dispatchable_order, request
from support.plants import plant

PLANT = read(sample_plant_path().read_bytes()).model
VEHICLES = ("Robot-01", "Robot-02")


def with_locations(*locations: Location) -> PlantModel:
    types = PLANT.location_types
    return PlantModel(name="changed", points=PLANT.points, location_types=types, locations=locations)


def findings(wanted: TransportOrderRequest) -> tuple[list[str], bool]:
    with pytest.raises(InvalidRequestError) as caught:
        check_request(wanted, PLANT, VEHICLES)
    return [str(finding.text) for finding in caught.value.findings], caught.value.only_unknown


@pytest.mark.parametrize(
    "wanted",
    [
        request("Goods in:Load cargo", "Storage:Unload cargo", intended_vehicle="Robot-01"),
        request("Goods in:NOP"),
        request("Middle 1", "Parking bay:PARK"),
        TransportOrderRequest.model_validate({"destinations": [{"coordinate": {"x": 1, "y": 2}}]}),
        request("Storage:NOP", properties=[{"key": "tcs:resourcesToAvoid", "value": "Middle gate,Packing"}]),
    ],
)
def test_valid_requests_pass(wanted: TransportOrderRequest) -> None:
    check_request(wanted, PLANT, VEHICLES)


def test_all_errors_are_reported_together() -> None:
    wanted = request(
        "Goods out:Load cargo",
        "Storage:Unload cargo",
        "Nowhere",
        "Middle 1:Load cargo",
        intended_vehicle="Robot-10",
        properties=[{"key": "tcs:resourcesToAvoid", "value": "Gone"}],
    )
    texts, only_unknown = findings(wanted)
    assert [text.split(":")[0] for text in texts[:3]] == ["Destination 1", "Destination 3", "Destination 4"]
    assert "Unload cargo" in texts[0]
    assert "'Nowhere'" in texts[1]
    assert "MOVE or PARK" in texts[2]
    assert "Did you mean" in texts[3]
    assert "'Gone'" in texts[4]
    assert not only_unknown


def test_only_unknown_names_are_distinguished() -> None:
    texts, only_unknown = findings(request("Goods inn:Load cargo"))
    assert "Did you mean 'Goods in'" in texts[0]
    assert only_unknown


def test_operation_at_a_coordinate_is_refused() -> None:
    wanted: dict[str, Any] = {"destinations": [{"coordinate": {"x": 1, "y": 2}, "operation": "Load cargo"}]}
    texts, _ = findings(TransportOrderRequest.model_validate(wanted))
    assert "a coordinate" in texts[0]


def test_locked_and_unlinked_locations_are_refused() -> None:
    storage, packing = PLANT.location("Storage"), PLANT.location("Packing")
    locked, unlinked = (
        storage.model_copy(update={"locked": True}),
        packing.model_copy(update={"links": ()}),
    )
    changed = with_locations(locked, unlinked)
    with pytest.raises(InvalidRequestError) as caught:
        check_request(request("Storage:NOP", "Packing:NOP"), changed, ())
    assert [str(finding.text).split(": ")[1].split(";")[0] for finding in caught.value.findings] == [
        "location 'Storage' is locked",
        "location 'Packing' has no link to a point, so no robot can reach it.",
    ]


def test_stored_order_keeps_a_destination_that_is_locked_later() -> None:
    locked = PLANT.location("Storage").model_copy(update={"locked": True})
    others = tuple(each for each in PLANT.locations if each.name != "Storage")
    check_order(dispatchable_order("Storage:NOP").status, with_locations(locked, *others))


def test_stored_order_is_checked_against_a_changed_plant() -> None:
    order = dispatchable_order("Storage:NOP").status
    check_order(order, PLANT)
    with pytest.raises(InvalidRequestError, match="'Storage'"):
        check_order(order, plant(points="A"))


def test_a_location_without_an_operation_is_only_driven_to() -> None:
    places = ({"locationName": "Storage"}, {"locationName": "Middle 1"}, {"coordinate": {"x": 1, "y": 2}})
    given = TransportOrderRequest.model_validate({"destinations": places})
    wanted = set_operations(given, PLANT)
    check_request(wanted, PLANT, VEHICLES)
    assert [each.operation for each in wanted.destinations] == ["NOP", "MOVE", "MOVE"]
    refused, _ = findings(set_operations(request("Storage:MOVE"), PLANT))
    assert "operation 'MOVE' is not possible" in refused[0]
