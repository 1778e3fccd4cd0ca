from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from nena_shared.plant import (
    Block,
    BoundingBox,
    ConnectionType,
    ControlPoint,
    EnergyThresholds,
    Envelope,
    Link,
    Location,
    LocationLayout,
    LocationType,
    ObjectKind,
    PathLayout,
    PeripheralOperation,
    PlantModel,
    Point,
    UnknownObjectError,
    Vehicle,
    Vertex,
)
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
            envelopes=(Envelope(key="e", vertices=(Vertex(x_mm=1, y_mm=2),)),),
            peripheral_operations=(PeripheralOperation(name="open", location="Door"),),
            layout=PathLayout(
                connection_type=ConnectionType.POLYPATH, control_points=(ControlPoint(x_mm=1.25, y_mm=-0.1),)
            ),
        ),
    ),
    location_types=(LocationType(name="T", allowed_operations=("Load", "Unload")),),
    locations=(
        Location(
            name="L ",
            type="T",
            links=(Link(point="A", allowed_operations=("Load", "Paint")), Link(point="B")),
            layout=LocationLayout(representation="NONE", position=Vertex(x_mm=5, y_mm=6)),
        ),
        Location(name="Door", type="T"),
    ),
    blocks=(Block(name="X", members=("A", "A --- B"), color="#00FF00"),),
    vehicles=(Vehicle(name="V", energy_thresholds=EnergyThresholds(critical=10), envelope_key="e"),),
    properties={"tcs:modelFileLastModified": "2024-11-21T14:01:30Z"},
)


def test_json_gives_the_same_model_back() -> None:
    assert PlantModel.from_json(FULL.to_json()) == FULL
    assert PlantModel.from_json(FULL.to_json().encode()) == FULL


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
def test_json_keeps_every_number_and_name_exactly(points: list[Point]) -> None:
    model = PlantModel(name="m", points=tuple(points))
    assert PlantModel.from_json(model.to_json()) == model


def test_json_has_camel_case_names_and_writes_defaults_out() -> None:
    text = plant(path("A B")).to_json()
    assert '"maxReverseVelocityMmS":0' in text
    assert '"xMm":0' in text
    assert "orientationDeg" not in text


def test_json_of_a_newer_writer_is_read() -> None:
    assert PlantModel.from_json('{"name": "m", "somethingNew": 1}') == PlantModel(name="m")


def test_a_model_cannot_be_changed() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        FULL.points[0].__setattr__("x_mm", 7)


def test_objects_are_found_by_name() -> None:
    assert FULL.point("A").x_mm == 1500
    assert FULL.path("A --- B").length_mm == 1521
    assert FULL.location("L ").type == "T"
    assert FULL.vehicle("V").envelope_key == "e"
    assert FULL.location_type("T").allowed_operations == ("Load", "Unload")
    assert FULL.blocks_by_name["X"].members == ("A", "A --- B")


def test_an_unknown_name_is_told_with_those_most_like_it() -> None:
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


def test_access_points_of_an_unknown_location() -> None:
    with pytest.raises(UnknownObjectError, match="no location 'L'"):
        FULL.access_points("L", "Load")
