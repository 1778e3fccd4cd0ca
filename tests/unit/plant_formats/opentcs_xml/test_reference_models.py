"""Real plant models, where they are at hand."""

import pytest

from nena_plant_formats.opentcs_xml import ImportReport, read
from nena_shared.plant import ConnectionType, EnergyThresholds, PlantModel, PointType
from support.reference import reference_dir

DEMO = "demo-01.v7.0.0.xml"
ALL_7 = "all-features.v7.0.0.xml"
ALL_4 = "all-features.v0.0.4.xml"
NENA = "nena-turtlebot3.v0.0.2.xml"


def report(name: str) -> ImportReport:
    return read(reference_dir("opentcs-plant-models", name).read_bytes())


def codes(name: str) -> list[tuple[str, str]]:
    return [(problem.code, problem.name) for problem in report(name).warnings]


@pytest.mark.parametrize(
    ("name", "points", "paths", "length_mm", "places"),
    [
        (DEMO, 59, 75, 514564, (4, 16, 2, 4)),
        (ALL_7, 15, 7, 47426, (1, 2, 2, 1)),
        (ALL_4, 15, 7, 47426, (1, 2, 2, 1)),
        (NENA, 6, 11, 274081, (1, 6, 0, 4)),
    ],
)
def test_contents_of_reference_models(
    name: str, points: int, paths: int, length_mm: int, places: tuple[int, int, int, int]
) -> None:
    model = report(name).model
    assert (len(model.points), len(model.paths)) == (points, paths)
    assert sum(path.length_mm for path in model.paths) == length_mm
    counts = (len(model.location_types), len(model.locations), len(model.blocks), len(model.vehicles))
    assert counts == places
    assert PlantModel.from_json(model.to_json()) == model


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        (DEMO, (-24000, 31000), (-21000, 15000)),
        (ALL_7, (5000, 35000), (5000, 15000)),
        (NENA, (1000, 36700), (-11300, 21800)),
    ],
)
def test_how_far_they_reach(name: str, x: tuple[int, int], y: tuple[int, int]) -> None:
    points = report(name).model.points
    assert (min(point.x_mm for point in points), max(point.x_mm for point in points)) == x
    assert (min(point.y_mm for point in points), max(point.y_mm for point in points)) == y


def test_demo_is_strongly_connected_and_warns_of_its_traps() -> None:
    assert codes(DEMO) == [("MISSPELT_PROPERTY", "Vehicle-01-VDA5050-2.0")]
    model = report(DEMO).model
    assert sum(point.type is PointType.PARK_POSITION for point in model.points) == 5
    assert sum(bool(point.envelopes) for point in model.points) == 8
    assert sum(bool(path.envelopes) for path in model.paths) == 4
    door = model.path("Point-0057 --- Point-0058").peripheral_operations
    assert [operation.location for operation in door] == ["Fire door 01", "Fire door 01"]


def test_all_features_are_the_same_in_both_formats() -> None:
    new, old = report(ALL_7).model, report(ALL_4).model
    assert [path.layout.control_points for path in new.paths] == [
        path.layout.control_points for path in old.paths
    ]
    assert new.locations == old.locations
    assert new.blocks == old.blocks
    assert new.visual_layout == old.visual_layout
    assert new.vehicles[0].energy_thresholds == old.vehicles[0].energy_thresholds
    assert new.vehicles[0].bounding_box.length_mm == old.vehicles[0].bounding_box.length_mm == 1500


def test_all_features_omits_what_7_0_0_lacks() -> None:
    assert [code for code in codes(ALL_4) if code[0] == "VALUE_REPLACED"] == [
        ("VALUE_REPLACED", "Point-0014"),
        ("VALUE_REPLACED", "Point-0013 --- Point-0014"),
    ]
    assert ("PATH_LOCKED", "Point-0013 --- Point-0014") in codes(ALL_4)
    assert {("LOCATION_WITHOUT_LINK", "Location-0002"), ("LOCATION_LOCKED", "Location-0002")} <= set(
        codes(ALL_7)
    )
    assert ("NOT_STRONGLY_CONNECTED", "PlantModelV7") in codes(ALL_7)


def test_odd_name_is_kept_and_swapped_thresholds_corrected() -> None:
    model = report(NENA).model
    assert model.location("Enschede ").links[0].point == "point-enschede"
    assert ("SUSPICIOUS_NAME", "Enschede ") in codes(NENA)
    assert {vehicle.energy_thresholds for vehicle in model.vehicles} == {
        EnergyThresholds(critical=30, good=90, sufficiently_recharged=30, fully_recharged=90)
    }
    assert [vehicle.color for vehicle in model.vehicles] == ["#FFFF00", "#00FFFF", "#FF0000", "#0000FF"]


def test_nena_has_curves_in_the_frame_of_its_points_and_locations_drawn_elsewhere() -> None:
    model = report(NENA).model
    assert sum(path.layout.connection_type is ConnectionType.BEZIER for path in model.paths) == 10
    first = model.path("point-almelo --- point-hengelo").layout.control_points[0]
    assert (first.x_mm, first.y_mm) == (3300, 13000)
    drawn = model.location("Almelo").layout.position
    assert drawn is not None
    assert (drawn.x_mm, drawn.y_mm) == (1750, 21250)
    assert model.location("Hengelo").layout.position is None
    assert ("CONTROL_POINTS_DROPPED", "point-almelo --- point-hengelo") not in codes(NENA)
