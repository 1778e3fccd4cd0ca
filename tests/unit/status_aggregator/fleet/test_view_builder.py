from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from nena_shared.fleet_api.transport_order import Coordinate, Destination, Hold
from nena_shared.vda5050.factsheet import Factsheet
from nena_status_aggregator.fleet.orders import TrackedOrder
from nena_status_aggregator.fleet.robot import Robot, Timestamp
from nena_status_aggregator.fleet.view_builder import LIST_LIMIT, destination_text, view_order, view_robot
from nena_status_aggregator.fleet.views import RobotView
from support.clocks import ManualClock
from support.fleet_examples import ROBOT, START, factsheet, order_status
from support.fleet_records import state
from support.robot_maps import robot_map


def shown(**fields: Any) -> RobotView:
    """Return the view of a robot with such a state."""
    now = Timestamp.of(ManualClock(start=START))
    robot = Robot(ROBOT, now)
    robot.on_state(state(**fields), now, retained=False)
    return view_robot(robot, silence_limit=35, skew_limit=2)


def test_information_is_published_with_its_references() -> None:
    goal = {
        "info_type": "externalGoal",
        "info_level": "INFO",
        "info_references": ({"reference_key": "goalId", "reference_value": "b7"},),
        "info_descriptor": "a goal of somebody else",
    }
    assert shown(information=(goal,))["information"] == [
        {
            "infoType": "externalGoal",
            "infoLevel": "INFO",
            "description": "a goal of somebody else",
            "references": {"goalId": "b7"},
        }
    ]
    assert shown()["information"] == []


def test_planned_path_is_rounded_to_centimetres_and_bounded() -> None:
    points = tuple(
        {"x": 0.12345 * at, "y": 1.0, "eta": datetime(2026, 1, 1, tzinfo=UTC)} for at in range(500)
    )
    plan = shown(intermediate_path={"polyline": points})["plan"]
    assert plan is not None
    assert plan[:2] == [(0.0, 1.0), (0.12, 1.0)]
    assert len(plan) == LIST_LIMIT
    assert shown()["plan"] is None


def test_the_first_footprint_of_the_factsheet_is_the_outline() -> None:
    now = Timestamp.of(ManualClock(start=START))
    robot = Robot(ROBOT, now)
    sheet = factsheet().model_dump(by_alias=True)
    corners = ({"x": 0.0, "y": -0.5}, {"x": 2.5, "y": 0.5})
    geometry = {"envelopes2d": ({"envelope2dId": "all", "vertices": corners},)}
    robot.factsheet = Factsheet.model_validate({**sheet, "mobileRobotGeometry": geometry}, strict=False)
    body = view_robot(robot, silence_limit=35, skew_limit=2)["body"]
    assert body is not None
    assert body["outline"] == [(0.0, -0.5), (2.5, 0.5)]
    robot.factsheet = factsheet()
    plain = view_robot(robot, silence_limit=35, skew_limit=2)["body"]
    assert plain is not None
    assert plain["outline"] is None


def test_pose_of_the_grid_map_is_published() -> None:
    now = Timestamp.of(ManualClock(start=START))
    robot = Robot(ROBOT, now)
    assert view_robot(robot, silence_limit=35, skew_limit=2)["grid"] is None
    robot.map = robot_map(x=-1.00004, theta=0.5)
    assert view_robot(robot, silence_limit=35, skew_limit=2)["grid"] == {
        "digest": "0123456789abcdef",
        "mapId": "hall",
        "x": -1.0,
        "y": 0.0,
        "theta": 0.5,
        "resolution": 0.5,
        "width": 40,
        "height": 20,
    }


def test_a_coordinate_is_named_by_its_metres() -> None:
    assert destination_text(Destination(coordinate=Coordinate(x=1.0, y=-2.345))) == "(1.00, -2.35)"


def test_an_order_as_hosts_know_it() -> None:
    view = view_order(TrackedOrder(order_status(version=3)), "C")
    assert (view["id"], view["name"], view["version"]) == ("TO-1", "TO-1", 3)
    assert (view["state"], view["final"], view["confirmed"]) == ("BEING_PROCESSED", False, True)
    assert view["created"] == "2026-01-01T00:00:00.000Z"
    assert (view["finished"], view["deadline"]) == (None, None)
    assert [each["place"] for each in view["destinations"]] == ["Goods in", "Packing"]


def test_hold_of_an_order() -> None:
    hold = Hold(by="Ann", reason="tea", since=START)
    view = view_order(TrackedOrder(order_status(held=hold)), None)
    since = "2026-01-01T00:00:00.000Z"
    assert view["held"] == {"by": "Ann", "reason": "tea", "codedReason": None, "since": since}
    assert view_order(TrackedOrder(order_status()), None)["held"] is None
