from itertools import permutations
from math import hypot

from nena_demo.plants import sample_plant_path
from nena_order_service.routing.router import Router
from nena_plant_formats.opentcs_xml import read
from nena_shared.plant import PointType
from support.fleet_examples import sample_plant


def test_the_sample_plant_has_no_findings() -> None:
    assert read(sample_plant_path().read_bytes()).warnings == ()


def test_sample_plant_has_the_objects_of_demo_and_guide() -> None:
    plant = sample_plant()
    assert len(plant.points) == 20
    assert set(plant.locations_by_name) == {"Goods in", "Goods out", "Packing", "Storage", "Charging station"}
    assert [point.name for point in plant.points if point.type is PointType.PARK_POSITION] == ["Parking bay"]
    assert plant.access_points("Charging station", "Charge") == ("Charging stand",)
    assert plant.access_points("Storage", "Load cargo") == ("Storage east stand", "Storage west stand")
    assert plant.access_points("Goods in", "Unload cargo") == ()
    assert all(0 <= point.x_m <= 24 and 0 <= point.y_m <= 14 for point in plant.points)


def test_its_robots_are_named_as_their_topics_are() -> None:
    robots = [
        (each.name, each.interface_name, each.manufacturer, each.serial_number, each.protocol_version)
        for each in sample_plant().vehicles
    ]
    assert robots == [
        ("Robot-01", None, "NeNa", "robot-01", "2.1.0"),
        ("Robot-02", None, "NeNa", "robot-02", "2.1.0"),
    ]
    assert {(each.map_id, each.deviation_xy_m) for each in sample_plant().vehicles} == {("sample-hall", 0.5)}


def test_lengths_are_distances() -> None:
    plant = sample_plant()
    for path in plant.paths:
        a, b = plant.point(path.source), plant.point(path.destination)
        assert path.length_mm == round(hypot(a.x_mm - b.x_mm, a.y_mm - b.y_mm)), path.name


def test_every_point_is_reachable_from_every_other() -> None:
    plant = sample_plant()
    router = Router(plant)
    for vehicle in plant.vehicles:
        for source, destination in permutations(plant.points_by_name, 2):
            assert router.route(source, destination, vehicle=vehicle).steps
