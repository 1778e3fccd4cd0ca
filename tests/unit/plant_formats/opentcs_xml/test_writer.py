"""What is written is read again as the same model."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_demo.plants import sample_plant_path
from nena_plant_formats.opentcs_xml import read, write
from nena_shared.plant import (
    Block,
    BoundingBox,
    ConnectionType,
    Envelope,
    Layer,
    LayerGroup,
    LayoutPoint,
    Location,
    LocationLayout,
    LocationType,
    PathLayout,
    PlantModel,
    PlantModelError,
    PlantVertex,
    PointType,
    Vehicle,
    VisualLayout,
)
from nena_shared.plant.track import VehicleTypeOnPath
from support.plants import path, plant, point
from support.reference import reference_dir

LAYOUT = VisualLayout(
    layers=(Layer(id=0, ordinal=0, name="ground"),), layer_groups=(LayerGroup(id=0, name="all"),)
)
NAMES = st.text(
    st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff"), min_size=1, max_size=8
)
PROPERTIES = st.dictionaries(NAMES, st.text("a<>&\"'\t\n\r ü", max_size=6), max_size=2)


def round_trip(model: PlantModel) -> PlantModel:
    return read(write(model).data).model


@pytest.mark.parametrize("name", ["demo-01.v7.0.0.xml", "all-features.v7.0.0.xml", "all-features.v0.0.4.xml"])
def test_reference_models_lose_nothing(name: str) -> None:
    model = read(reference_dir("opentcs-plant-models", name).read_bytes()).model
    written = write(model)
    assert written.warnings == ()
    assert read(written.data).model == model


def test_oldest_format_loses_what_only_its_drawing_contains() -> None:
    data = reference_dir("opentcs-plant-models", "nena-turtlebot3.v0.0.2.xml").read_bytes()
    model = read(data).model
    written = write(model)
    moved = {each.name for each in model.locations if each.layout.position}
    assert {(each.code, each.name) for each in written.warnings} == {("NOT_EXPORTED", name) for name in moved}
    again = read(written.data).model
    assert again.points == model.points
    assert again.paths == model.paths
    assert again.vehicles == model.vehicles
    assert [layer.id for layer in again.visual_layout.layers] == [0]
    assert round_trip(again) == again


def test_the_sample_plant_loses_nothing() -> None:
    model = read(sample_plant_path().read_bytes()).model
    assert round_trip(model) == model


def test_complete_model_round_trip() -> None:
    square = Envelope(key="k", vertices=(PlantVertex(x_mm=0, y_mm=-5), PlantVertex(x_mm=7, y_mm=0)))
    curve = PathLayout(
        connection_type=ConnectionType.BEZIER,
        control_points=(LayoutPoint(x_mm=100, y_mm=-250), LayoutPoint(x_mm=0, y_mm=50)),
    )
    model = PlantModel(
        name='hall "3" <north> & ',
        points=(
            point(
                "A", 1, -2, z_mm=3, orientation_deg=-12.5, type=PointType.PARK_POSITION, envelopes=(square,)
            ),
            point("B", max_vehicle_bounding_box=BoundingBox(length_mm=2, reference_offset_x_mm=-1)),
        ),
        paths=(path("A B", 7, max_reverse_velocity_mm_s=9, locked=True, envelopes=(square,), layout=curve),),
        location_types=(LocationType(name="T", allowed_operations=("Load",), representation="NONE"),),
        locations=(Location(name="L", type="T", locked=True, layout=LocationLayout(representation="NONE")),),
        blocks=(Block(name="K", members=("A", "A --- B", "L"), color="#00FF00"),),
        vehicles=(Vehicle(name="V", envelope_key="k", properties={"tcs:routingGroup": "g"}),),
        visual_layout=LAYOUT,
        properties={"key": " value "},
    )
    assert round_trip(model) == model


@given(names=st.lists(NAMES, min_size=2, max_size=4, unique=True), properties=PROPERTIES)
def test_names_and_values_are_preserved(names: list[str], properties: dict[str, str]) -> None:
    points = tuple(point(name, properties=properties) for name in names)
    model = PlantModel(name=names[0], points=points, visual_layout=LAYOUT)
    assert round_trip(model) == model


def test_layers_that_are_used_and_described_nowhere_are_added() -> None:
    model = plant(path("A B", layout=PathLayout(layer_id=4)))
    layout = round_trip(model).visual_layout
    assert [layer.id for layer in layout.layers] == [0, 4]
    assert [group.id for group in layout.layer_groups] == [0]


@pytest.mark.parametrize(
    "more", [{"name": "bell\u0007"}, {"name": "nothing \uffff"}, {"properties": {"k": "\u0000"}}]
)
def test_text_that_xml_cannot_hold_is_refused(more: dict[str, Any]) -> None:
    model = PlantModel(name="m", points=(point(**{"name": "A", **more}),))
    with pytest.raises(PlantModelError) as caught:
        write(model)
    assert {problem.code for problem in caught.value.problems} == {"UNWRITABLE_TEXT"}


def test_lost_vehicle_type_rules_are_reported() -> None:
    uses = (VehicleTypeOnPath(vehicle_type_id="t", rotation_allowed=True),)
    written = write(plant(path("A B", vehicle_types=uses)))
    assert {problem.code for problem in written.warnings} == {"NOT_EXPORTED"}
    assert any("rules of rotation (1 times)" in problem.text for problem in written.warnings)
    assert read(written.data).model.path("A --- B").vehicle_types == ()
