from typing import Any

import pytest

from nena_shared.plant import (
    Block,
    Link,
    Location,
    LocationType,
    PeripheralOperation,
    PlantModel,
    PointType,
    Vehicle,
)
from nena_shared.plant import property_keys as keys
from nena_shared.plant.checks import disconnected_points, find_errors, find_property_warnings, find_warnings
from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.track import VehicleTypeAtPoint
from support.plants import grid_plant, path, plant, point

TYPE = LocationType(name="T", allowed_operations=("Load", "Charge"))
OF_TYPE = Location(name="L", type="T", links=(Link(point="A"),))


def good(**more: Any) -> PlantModel:
    model = plant(path("A B"), path("B A"), location_types=(TYPE,), **more)
    park = model.points[0].model_copy(update={"type": PointType.PARK_POSITION})
    return model.model_copy(update={"points": (park, *model.points[1:])})


def codes(model: PlantModel) -> list[tuple[str, str]]:
    return [(problem.code, problem.name) for problem in (*find_errors(model), *find_warnings(model))]


def test_a_good_model_has_no_findings() -> None:
    assert codes(good(locations=(OF_TYPE,))) == []


def test_names_are_unique_over_all_kinds_of_object() -> None:
    model = good(vehicles=(Vehicle(name="A"),), blocks=(Block(name="T"),))
    assert [(problem.kind, problem.name) for problem in find_errors(model)] == [
        ("point", "A"),
        ("location type", "T"),
        ("block", "T"),
        ("vehicle", "A"),
    ]


def test_name_of_a_backward_edge_is_reserved() -> None:
    block = Block(name="A --- B:backward")
    two_ways = (path("A B", max_reverse_velocity_mm_s=1), path("B A"))
    assert ("DUPLICATE_NAME", "A --- B") in codes(plant(*two_ways, blocks=(block,)))
    assert codes(good(blocks=(block,))) == []


def test_every_dangling_reference_is_named() -> None:
    model = plant(
        path("A B", peripheral_operations=(PeripheralOperation(name="open", location="Door"),)),
        locations=(Location(name="L", type="Nothing", links=(Link(point="Z"),)),),
        blocks=(Block(name="X", members=("A", "A --- B", "L", "Q")),),
    ).model_copy(update={"points": ()})
    errors = find_errors(model)
    assert {problem.code for problem in errors} == {"UNKNOWN_REFERENCE"}
    assert [(problem.name, problem.text.split("'")[1]) for problem in errors] == [
        ("A --- B", "A"),
        ("A --- B", "B"),
        ("A --- B", "Door"),
        ("L", "Nothing"),
        ("L", "Z"),
        ("X", "A"),
        ("X", "Q"),
    ]


@pytest.mark.parametrize("name", ["Enschede ", " Enschede", "En\tschede", "Zero\u200bwidth"])
def test_suspicious_names_are_reported_unchanged(name: str) -> None:
    model = good(blocks=(Block(name=name),))
    assert codes(model) == [("SUSPICIOUS_NAME", name)]


@pytest.mark.parametrize("key", [keys.VDA5050_MANUFACTURER, keys.VDA5050_SERIAL_NUMBER])
@pytest.mark.parametrize(
    ("name", "odd"), [("r1 ", True), (" r1", True), ("r 1", True), ("r.1", True), ("r1", False)]
)
def test_a_name_in_topics_that_some_brokers_refuse_is_a_warning(key: str, name: str, *, odd: bool) -> None:
    vehicle = Vehicle(name="V", properties={key: name})
    found = [each for each in find_warnings(good(vehicles=(vehicle,))) if each.kind is ObjectKind.VEHICLE]
    assert [(each.code, each.name) for each in found] == [("SUSPICIOUS_NAME", "V")] * odd
    assert all(repr(name) in each.text for each in found)


@pytest.mark.parametrize(
    ("more", "finding"),
    [
        ({"points": "C"}, ("POINT_WITHOUT_PATH", "C")),
        ({"locations": (Location(name="L", type="T"),)}, ("LOCATION_WITHOUT_LINK", "L")),
        ({"locations": (Location(name="L", type="T", locked=True),)}, ("LOCATION_LOCKED", "L")),
        (
            {"locations": (Location(name="L", type="T", links=(Link(point="A"), Link(point="A"))),)},
            ("DUPLICATE_LINK", "L"),
        ),
        (
            {
                "locations": (
                    Location(name="L", type="T", links=(Link(point="A", allowed_operations=("Paint",)),)),
                )
            },
            ("OPERATION_NOT_OF_TYPE", "L"),
        ),
    ],
)
def test_suspicious_content_is_found(more: dict[str, Any], finding: tuple[str, str]) -> None:
    assert finding in codes(good(**more))


def test_unusable_tracks_are_reported() -> None:
    found = codes(plant(path("A B", locked=True), path("B A", max_velocity_mm_s=0)))
    assert ("PATH_LOCKED", "A --- B") in found
    assert ("PATH_NOT_DRIVABLE", "B --- A") in found
    assert ("NO_PARK_POSITION", "test") in found


@pytest.mark.parametrize(("length", "found"), [(4, True), (100, False), (12_000_000, True)])
def test_lengths_in_another_unit_are_found(length: int, *, found: bool) -> None:
    model = plant(path("A B", length), path("B A", length))
    assert (("IMPLAUSIBLE_LENGTHS", "test") in codes(model)) is found


def test_points_that_are_cut_off_are_named() -> None:
    model = plant(path("A B"), path("B A"), path("A C"))
    texts = [problem.text for problem in find_warnings(model) if problem.code == "NOT_STRONGLY_CONNECTED"]
    assert texts == ["not every point is reachable from every other; disconnected: 'C'"]


CHARGER = LocationType(name="Charger", allowed_operations=("Charge",))


def with_property(key: str, value: str) -> PlantModel:
    return plant(
        points="A",
        vehicles=(Vehicle(name="V", properties={key: value}),),
        location_types=(CHARGER,),
        locations=(Location(name="Dock", type="Charger"),),
    )


@pytest.mark.parametrize(
    ("key", "value", "code"),
    [
        ("vda5050:maxStepsBase ", "3", "MISSPELT_PROPERTY"),
        ("vda5050:serialnumber", "r1", "MISSPELT_PROPERTY"),
        ("VDA5050:mapId", "hall", "MISSPELT_PROPERTY"),
        ("tcs:preferedParkingPosition", "A", "MISSPELT_PROPERTY"),
        ("vda5050.serialNumber", "r1", "MISSPELT_PROPERTY"),
        ("TCS_preferredparkingposition", "A", "MISSPELT_PROPERTY"),
        ("vda5050:mapId", " ", "EMPTY_PROPERTY"),
        ("vda5050:deviationXY", "half a metre", "PROPERTY_NOT_A_NUMBER"),
        ("vda5050:deviationXY", "-1", "PROPERTY_NOT_A_NUMBER"),
        ("tcs:assignedParkingPosition", "B", "PROPERTY_NAMES_NOTHING"),
        ("tcs:preferredRechargeLocation", "A", "PROPERTY_NAMES_NOTHING"),
    ],
)
def test_suspicious_properties(key: str, value: str, code: str) -> None:
    found = list(find_property_warnings(with_property(key, value)))
    assert [(problem.code, problem.name) for problem in found] == [(code, "V")]
    assert repr(key) in found[0].text


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("vda5050:deviationXY", "0.5"),
        ("tcs:assignedParkingPosition", "A"),
        ("tcs:preferredRechargeLocation", "Dock"),
        ("vda5050:maxStepsBase", "3"),
        ("tcs:preferredAdapterClass", "org.example.Factory"),
        ("loopback:acceleration", "500"),
        ("serialnumber", "r1"),
    ],
)
def test_properties_in_order_and_those_of_others(key: str, value: str) -> None:
    assert list(find_property_warnings(with_property(key, value))) == []


def test_properties_of_all_kinds_of_object_are_looked_at() -> None:
    model = PlantModel(
        name="m",
        points=(point("A", properties={"a": ""}),),
        paths=(path("A A", name="P", properties={"a": ""}),),
        properties={"a": ""},
    )
    assert [problem.name for problem in find_property_warnings(model)] == ["m", "A", "P"]


def test_missing_charging_location_is_reported_if_there_are_vehicles() -> None:
    loading = LocationType(name="T", allowed_operations=("charge",))
    model = plant(vehicles=(Vehicle(name="V"),), location_types=(loading,), locations=(OF_TYPE,))
    (found,) = find_property_warnings(model)
    assert found.code == "NO_RECHARGE_OPERATION"
    assert "'charge' is a different operation" in found.text
    assert list(find_property_warnings(plant(location_types=(loading,)))) == []


def test_a_type_without_locations_recharges_nobody() -> None:
    (found,) = find_property_warnings(plant(vehicles=(Vehicle(name="V"),), location_types=(CHARGER,)))
    assert found.code == "NO_RECHARGE_OPERATION"


@pytest.mark.parametrize(
    ("own", "allowed", "name"),
    [
        ("CHARGE", "CHARGE", None),
        ("Lade", "Lade", None),
        (None, "CHARGE", None),  # an operation that recharges by default
        ("CHARGE", "Charge", "V"),
        ("Charge:50", "Charge", "V"),
        (None, "Charge:50", "test"),
    ],
)
def test_each_vehicle_has_an_operation_that_recharges_it(
    own: str | None, allowed: str, name: str | None
) -> None:
    vehicle = Vehicle(name="V", properties={"vda5050:rechargeOperation": own} if own else {})
    allowing = LocationType(name="T", allowed_operations=(allowed,))
    model = plant(vehicles=(vehicle,), location_types=(allowing,), locations=(OF_TYPE,))
    found = list(find_property_warnings(model))
    assert [(each.code, each.name) for each in found] == ([("NO_RECHARGE_OPERATION", name)] if name else [])
    assert not own or all(repr(own) in each.text for each in found)


def keyed(of: str, **properties: str) -> PlantModel:
    """Return a plant whose objects of one kind have these properties; ``_`` stands for a dot."""
    given = {of: {f"vda5050:{name}".replace("_", "."): value for name, value in properties.items()}}
    return PlantModel(
        name="m",
        points=(point("A", properties=given.get("point", {})), point("B", properties=given.get("point", {}))),
        paths=(path("A B", properties=given.get("path", {})), path("B A")),
        location_types=(
            LocationType(
                name="T", allowed_operations=("Charge", "Load.Now"), properties=given.get("type", {})
            ),
        ),
        locations=(Location(name="L", type="T", properties=given.get("location", {})),),
        vehicles=(Vehicle(name="V", properties=given.get("vehicle", {})),),
    )


ACTS = {"action_01": "beep", "action_01_blockingType": "SOFT", "action_01_parameter_x": "float:1.5"}


@pytest.mark.parametrize(
    ("of", "properties"),
    [
        ("point", {**ACTS, "action_01_when": "PASSING | ORDER_END", "action_01_tags": "a|b"}),
        ("point", {"deviationXY": "0.2", "deviationTheta": "5", "mapId": "hall"}),
        (
            "path",
            {**ACTS, "actionTags": "", "orientation_forward": "-90.5", "rotationAllowed_reverse": "TRUE"},
        ),
        ("location", {**ACTS, "destinationAction_Load_Now_parameter_a_b": "boolean:false"}),
        ("type", {"destinationAction_Load_Now_blockingType": "HARD"}),
        ("vehicle", {"action_open_door_blockingType": "HARD", "actionTags": "a | b", "maxStepsBase": "1"}),
        ("vehicle", {"optionalParams_order_edges_maxSpeed": "NOT_SUPPORTED", "maxDistanceBase": "5000"}),
        ("vehicle", {"vehicleLengthLoaded": "2400", "topicPrefix": "a/b", "errors_fatal": "x"}),
    ],
)
def test_keys_of_the_driver_that_have_an_effect(of: str, properties: dict[str, str]) -> None:
    assert list(find_property_warnings(keyed(of, **properties))) == []


@pytest.mark.parametrize(
    ("of", "properties", "code", "word"),
    [
        ("vehicle", {"maxStepsHorizon": "3"}, "NOT_HEEDED", "found 1 times"),
        ("point", {"topicStateQos": "1"}, "NOT_HEEDED", "found 2 times"),
        ("point", {"orientation_forward": "1"}, "NOT_HEEDED", "found 2 times"),
        ("path", {"deviationXY": "1"}, "NOT_HEEDED", "found 1 times"),
        ("vehicle", {"optionalParams_order_edges_colour": "NOT_SUPPORTED"}, "NOT_HEEDED", "colour"),
        ("vehicle", {"somethingElse": "1"}, "NOT_HEEDED", "somethingElse"),
        ("path", {"orientation_foward": "1"}, "MISSPELT_PROPERTY", "'vda5050:orientation.forward'"),
        ("vehicle", {"maxDistancebase": "1"}, "MISSPELT_PROPERTY", "'vda5050:maxDistanceBase'"),
        (
            "point",
            {"action_01": "beep", "action_01_blockingtype": "NONE"},
            "MISSPELT_PROPERTY",
            "(found 2 times); did you mean 'vda5050:action.01.blockingType'",
        ),
        (
            "location",
            {"destinationAktion_Charge_parameter_x": "1"},
            "MISSPELT_PROPERTY",
            "'vda5050:destinationAction.Charge.parameter.x'",
        ),
        ("path", {"orientation_forward": "left"}, "PROPERTY_UNREADABLE", "'left'; it must be a number"),
        ("path", {"orientation_forward": "nan"}, "PROPERTY_UNREADABLE", "'nan'"),
        ("path", {"rotationAllowed_forward": "no"}, "PROPERTY_UNREADABLE", "true or false"),
        ("path", {"action_1": "x", "action_1_blockingType": "hardest"}, "PROPERTY_UNREADABLE", "NONE, SOFT"),
        ("path", {"action_1": "x", "action_1_when": "ALWAYS"}, "PROPERTY_UNREADABLE", "PASSING"),
        ("path", {"action_1": "x", "action_1_parameter_n": "integer:1.5"}, "PROPERTY_UNREADABLE", "colon"),
        ("vehicle", {"maxStepsBase": "0"}, "PROPERTY_UNREADABLE", "whole number"),
        ("vehicle", {"vehicleLengthLoaded": "2.4"}, "PROPERTY_UNREADABLE", "whole number"),
        ("vehicle", {"optionalParams_order_edges_maxSpeed": "no"}, "PROPERTY_UNREADABLE", "REQUIRED"),
        ("point", {"action_2_blockingType": "HARD"}, "PROPERTY_NAMES_NOTHING", "'vda5050:action.2'"),
        ("location", {"destinationAction_Laod_parameter_x": "1"}, "PROPERTY_NAMES_NOTHING", "operation"),
    ],
)
def test_keys_of_the_driver_without_effect_are_found(
    of: str, properties: dict[str, str], code: str, word: str
) -> None:
    found = list(find_property_warnings(keyed(of, **properties)))
    assert {each.code for each in found} == {code}
    assert word in found[0].text
    assert code not in ("NOT_HEEDED", "MISSPELT_PROPERTY") or len(found) == 1


@pytest.mark.parametrize("key", ["tcs:vehicleDataTransformer", "tcs:coordinateSystemMapper.translation.x"])
def test_keys_of_opentcs_without_effect_are_found(key: str) -> None:
    assert [each.code for each in find_property_warnings(with_property(key, "1"))] == ["NOT_HEEDED"]


@pytest.mark.parametrize(
    ("known", "own", "found"),
    [((), "t", []), (("t",), "t", []), (("u",), "t", ["PROPERTY_NAMES_NOTHING"])],
)
def test_unknown_vehicle_type_is_reported_if_the_plant_defines_any(
    known: tuple[str, ...], own: str, found: list[str]
) -> None:
    uses = tuple(VehicleTypeAtPoint(vehicle_type_id=each) for each in known)
    vehicle = Vehicle(name="V", properties={"nena:vehicleType": own})
    model = PlantModel(
        name="m",
        points=(point("A", vehicle_types=uses),),
        vehicles=(vehicle,),
        location_types=(CHARGER,),
        locations=(Location(name="L", type="Charger", links=(Link(point="A"),)),),
    )
    assert [problem.code for problem in find_property_warnings(model)] == found


def test_a_reverse_speed_leads_out_of_a_dead_end() -> None:
    model = plant(path("A B"), path("B A"), path("B D", max_reverse_velocity_mm_s=300))
    assert disconnected_points(model) == ()


def test_a_locked_path_leads_nowhere() -> None:
    assert disconnected_points(plant(path("A B"), path("B A"), path("B C"), path("C B", locked=True))) == (
        "C",
    )


def test_the_smaller_part_is_the_one_cut_off() -> None:
    grid = grid_plant(3, 3)
    island = plant(path("X Y"), path("Y X"))
    model = PlantModel(name="both", points=(*island.points, *grid.points), paths=(*island.paths, *grid.paths))
    assert disconnected_points(model) == ("X", "Y")
