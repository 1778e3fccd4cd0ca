"""What is stored of a drive, and how much of it a robot has."""

from __future__ import annotations

import pytest

from nena_order_service.fleet.position import RobotProfile, TooFarError, locate, max_distance_m
from nena_order_service.orders.drive import Drive, DriveState
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.traffic.route_search import AllocatedRoute
from nena_shared.plant import PlantModel, Point
from support.fleet import make_vda_order
from support.fleet_examples import state
from support.order_service import assigned_order
from support.scripted_fleet import key

WAY = tuple(ResourceSet(name, 1000, {name: None}) for name in "BCDE")
ORDER = assigned_order("A", "E")
ROUTE = make_vda_order("V-1-0", *"ABCDE")
RECORD = Drive.to_current_destination(ORDER, key("V1"), retriable=True).granted(ROUTE, WAY)


def base(record: Drive) -> list[str]:
    return [node.node_id for node in record.as_released().nodes if node.released]


def test_a_stored_drive_is_read_unchanged() -> None:
    record = RECORD.released(AllocatedRoute(WAY, 2, released=2)).updated(state=DriveState.ACCEPTED)

    assert Drive.model_validate_json(record.document()) == record
    assert (record.update_id, record.allocated, record.robot) == (1, 2, key("V1"))


def test_a_drive_whose_route_is_withdrawn_requests_another_one() -> None:
    assert RECORD.requested_again().granted(ROUTE, WAY) == RECORD
    assert RECORD.requested_again().state is DriveState.REQUESTED


def test_the_base_is_what_is_allocated() -> None:
    assert base(RECORD.released(AllocatedRoute(WAY, 0, released=0))) == ["A"]
    assert base(RECORD.released(AllocatedRoute(WAY, 2, released=2))) == ["A", "B", "C"]
    assert base(RECORD.released(AllocatedRoute(WAY, 4, released=4))) == ["A", "B", "C", "D", "E"]
    assert RECORD.released(AllocatedRoute(WAY, 4, released=4)).all_released


def test_an_order_that_ends_early_has_no_horizon() -> None:
    record = RECORD.released(AllocatedRoute(WAY, 2, released=2)).ending_early(partial=True)

    assert [node.node_id for node in record.vda_order.nodes] == ["A", "B", "C"]
    assert len(record.vda_order.edges) == len(record.way) == 2
    assert (record.partial, record.all_released, record.update_id) == (True, True, 1)


def test_a_completely_released_order_is_unchanged() -> None:
    record = RECORD.released(AllocatedRoute(WAY, 4, released=4))

    assert record.ending_early(partial=True) is record


def test_a_vehicle_at_a_coordinate_may_be_far_from_all_points() -> None:
    plant = PlantModel(name="one", points=(Point(name="A", x_mm=0, y_mm=0),))
    profile = RobotProfile(map_id="map", max_distance_m=max_distance_m(plant))
    pose = {"x": 30.0, "y": 0.0, "theta": 0.0, "map_id": "map", "localized": True}
    with pytest.raises(TooFarError, match="30 m from the nearest point 'A'"):
        locate(plant, state(last_node_id="A", mobile_robot_position=pose), profile)

    found = locate(plant, state(last_node_id="goal:T-1-0", mobile_robot_position=pose), profile)

    assert (found.point, found.on_point, found.distance_m) == ("A", False, 30.0)
