from __future__ import annotations

from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_shared.plant import (
    Block,
    BoundingBox,
    ConnectionType,
    EnergyThresholds,
    Envelope,
    LayoutPoint,
    Link,
    Location,
    LocationLayout,
    LocationType,
    ObjectKind,
    PathLayout,
    PeripheralOperation,
    PlantModel,
    PlantVertex,
    Point,
    UnknownObjectError,
    Vehicle,
)
from nena_shared.plant.checks import find_errors, find_warnings
from nena_shared.plant.geometry import MapTransform, parse_transform
from nena_shared.plant.model import ACTION_TYPES, action_of, map_transforms, operation_of
from support.plants import path, plant, point

FULL = PlantModel(
    name="full",
    points=(
        point("A", 1500, -250, orientation_deg=270.0, properties={"k": "v"}),
        point("B", 3000, max_vehicle_bounding_box=BoundingBox(length_mm=700)),
    ),
    paths=(
        path(
            "A B",
            1521,
            max_reverse_velocity_mm_s=300,
            locked=True,
            envelopes=(Envelope(key="e", vertices=(PlantVertex(x_mm=1, y_mm=2),)),),
            peripheral_operations=(PeripheralOperation(name="open", location="Door"),),
            layout=PathLayout(
                connection_type=ConnectionType.POLYPATH,
                control_points=(LayoutPoint(x_mm=1.25, y_mm=-0.1),),
            ),
        ),
    ),
    location_types=(LocationType(name="T", allowed_operations=("Load", "Unload")),),
    locations=(
        Location(
            name="L ",
            type="T",
            links=(Link(point="A", allowed_operations=("Load", "Paint")), Link(point="B")),
            layout=LocationLayout(representation="NONE", position=PlantVertex(x_mm=5, y_mm=6)),
        ),
        Location(name="Door", type="T"),
    ),
    blocks=(Block(name="X", members=("A", "A --- B"), color="#00FF00"),),
    vehicles=(Vehicle(name="V", energy_thresholds=EnergyThresholds(critical=10), envelope_key="e"),),
    properties={"tcs:modelFileLastModified": "2024-11-21T14:01:30Z"},
)


@given(
    st.lists(
        st.builds(
            Point,
            name=st.text(min_size=1),
            x_mm=st.integers(-(10**17), 10**17),
            y_mm=st.integers(-(10**17), 10**17),
            orientation_deg=st.none() | st.floats(-360, 360),
            properties=st.dictionaries(st.text(), st.text()),
        )
    )
)
def test_json_preserves_numbers_and_names(points: list[Point]) -> None:
    model = PlantModel(name="m", points=tuple(points))
    assert PlantModel.from_json(model.to_json()) == model


def test_json_of_a_newer_writer_is_read() -> None:
    assert PlantModel.from_json('{"name": "m", "somethingNew": 1}') == PlantModel(name="m")


def test_unknown_name_error_suggests_similar_names() -> None:
    with pytest.raises(UnknownObjectError) as caught:
        plant(points="Dock-1 Dock-2 Park").point("Dock-3")
    assert caught.value.kind is ObjectKind.POINT
    assert caught.value.name == "Dock-3"
    assert set(caught.value.suggestions) == {"Dock-1", "Dock-2"}
    assert "Did you mean 'Dock-" in str(caught.value)


def test_metres_and_radians() -> None:
    a = FULL.point("A")
    assert (a.x_m, a.y_m) == (1.5, -0.25)
    assert a.heading_rad == pytest.approx(-pi / 2)
    assert FULL.point("B").heading_rad is None
    assert FULL.path("A --- B").length_m == 1.521


def test_operations_of_a_link_are_those_of_the_type_which_it_does_not_exclude() -> None:
    location = FULL.location("L ")
    assert FULL.link_operations(location, location.links[0]) == ("Load",)
    assert FULL.link_operations(location, location.links[1]) == ("Load", "Unload")


@pytest.mark.parametrize(
    ("operation", "points"), [("Load", ("A", "B")), ("Unload", ("B",)), ("NOP", ("A", "B")), ("Paint", ())]
)
def test_access_points_depend_on_the_operation(operation: str, points: tuple[str, ...]) -> None:
    assert FULL.access_points("L ", operation) == points


def test_properties_say_how_the_robot_is_reached() -> None:
    vehicle = Vehicle(
        name="V",
        max_velocity_mm_s=1200,
        properties={
            "vda5050:interfaceName": "uagv",
            "vda5050:manufacturer": "ACME",
            "vda5050:serialNumber": "r1",
            "vda5050:version": "2.1.0",
            "vda5050:mapId": "hall",
            "vda5050:deviationXY": "0.25",
            "vda5050:deviationTheta": "180",
            "tcs:routingGroup": "wide",
        },
    )
    assert (vehicle.interface_name, vehicle.manufacturer, vehicle.serial_number) == ("uagv", "ACME", "r1")
    assert (vehicle.protocol_version, vehicle.map_id, vehicle.routing_group) == ("2.1.0", "hall", "wide")
    assert vehicle.deviation_xy_m == 0.25
    assert vehicle.deviation_theta_rad == pytest.approx(pi)
    assert vehicle.max_velocity_m_s == 1.2


@pytest.mark.parametrize("value", ["wide", "-1", "nan", "inf", ""])
def test_a_deviation_that_is_no_number_from_0_up_is_not_set(value: str) -> None:
    assert Vehicle(name="V", properties={"vda5050:deviationXY": value}).deviation_xy_m is None


@pytest.mark.parametrize(
    "levels", [{"critical": 50, "good": 40}, {"sufficiently_recharged": 91}, {"good": 101}, {"critical": -1}]
)
def test_thresholds_are_percent_and_not_crossed(levels: dict[str, int]) -> None:
    with pytest.raises(ValidationError):
        EnergyThresholds(**levels)


@pytest.mark.parametrize(
    ("operation", "action"),
    [("Load cargo", "pick"), ("Unload", "drop"), ("Charge", "startCharging"), ("beep", "beep")],
)
def test_operations_with_standard_actions_are_mapped(operation: str, action: str) -> None:
    assert action_of(operation) == action


def test_only_charging_maps_back_to_an_operation() -> None:
    assert operation_of("startCharging") == "Charge"
    others = set(ACTION_TYPES.values()) - {"startCharging"}
    assert {operation_of(each) for each in others} == others


def test_each_map_has_its_own() -> None:
    properties = {
        "nena:mapTransform.hall": "scale=0.1 rotation=90 x=5 y=-1",
        "nena:mapTransform.yard": "x=-2.5",
        "key": "x=1",
    }
    model = plant(points="A", properties=properties)
    assert map_transforms(model) == {
        "hall": MapTransform(scale=0.1, rotation_rad=pi / 2, offset_x_m=5, offset_y_m=-1),
        "yard": MapTransform(offset_x_m=-2.5),
    }
    assert find_errors(model) == ()
    assert "MISSPELT_PROPERTY" not in {problem.code for problem in find_warnings(model)}


@pytest.mark.parametrize(
    "text", ["", "90", "scale=0", "scale=-1", "x=", "x=inf", "x=1 z=2", "x=1 x=2", "x = 1"]
)
def test_invalid_transform_makes_the_model_unusable(text: str) -> None:
    with pytest.raises(ValueError, match=r"transform|form|float"):
        parse_transform(text)
    model = plant(points="A", properties={"nena:mapTransform.hall": text})
    (error,) = find_errors(model)
    assert error.code == "BAD_VALUE"
    assert "'hall'" in error.text
