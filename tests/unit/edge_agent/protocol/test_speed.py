"""The robot slows down before an edge with a lower limit, where it passes the node before it."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import Arrived, Pose, PoseReport
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import Drive, LimitSpeed
from nena_shared.vda5050.order import Order
from support.robot_core import MAP, Bench, order, position


def slow_behind_n1(speed: float = 0.3) -> Order:
    """Return an order whose second edge has a limit."""
    plain = order("n0", "n1", "n2")
    first, second = plain.edges
    edges = (first, second.model_copy(update={"maximum_speed": speed}))
    return plain.model_copy(update={"edges": edges})


def driving(**capabilities: Any) -> Bench:
    chosen: dict[str, Any] = {
        "strategy": DriveStrategy.PASS_THROUGH,
        "braking_distance": 1.5,
        "limits_speed": True,
    }
    robot = Bench(**(chosen | capabilities))
    robot.send(slow_behind_n1())
    return robot


def go(robot: Bench, x: float) -> None:
    robot.do(PoseReport(Pose(x, 0.0, 0.0, MAP), localized=True))


def limits(robot: Bench) -> list[float | None]:
    return [each.speed for each in robot.effects_of(LimitSpeed)]


@pytest.mark.clause("7.3/speed")
def test_the_robot_slows_down_before_an_edge_with_a_limit() -> None:
    robot = driving()
    go(robot, 8.4)
    assert limits(robot) == []

    go(robot, 8.6)
    assert limits(robot) == [0.3]
    go(robot, 9.9)

    assert robot.goal.maximum_speed == 0.3
    assert limits(robot) == [0.3, None]


def leaving(*speeds: float | None, **capabilities: Any) -> Bench:
    """Return a robot 9.5 m along an order whose edges of 10 m have these limits, with nodes 1 m around."""
    chosen: dict[str, Any] = {"strategy": DriveStrategy.PASS_THROUGH, "pass_radius": 1.0}
    robot = Bench(**(chosen | capabilities))
    nodes = [f"n{number}" for number in range(len(speeds) + 1)]
    plain = order(*nodes, positions={each: position(10.0 * at, radius=1.0) for at, each in enumerate(nodes)})
    edges = zip(plain.edges, speeds, strict=True)
    limited = tuple(edge.model_copy(update={"maximum_speed": speed}) for edge, speed in edges)
    robot.send(plain.model_copy(update={"edges": limited}))
    go(robot, 8.5)
    go(robot, 9.5)
    return robot


@pytest.mark.clause("7.3/speed")
def test_the_limit_of_an_edge_holds_until_the_robot_has_left_it() -> None:
    robot = leaving(0.3, None)
    assert robot.state.last_node_id == "n1"
    kinds = [type(each) for each in robot.effects if isinstance(each, LimitSpeed | Drive)]
    assert kinds[-2:] == [LimitSpeed, Drive], "the limit of the edge comes before the goal that has none"
    go(robot, 9.95)
    assert limits(robot) == [0.3]
    go(robot, 10.01)
    assert limits(robot) == [0.3, None]


def test_the_stricter_limit_of_both_edges_holds_between_them() -> None:
    for before, after in ((0.3, 0.2), (0.2, 0.3)):
        robot = leaving(before, after)
        assert (limits(robot)[-1], robot.goal.maximum_speed) == (before, after), (
            "the driver takes the lower one"
        )
        go(robot, 10.1)
        assert (limits(robot)[-1], robot.goal.maximum_speed) == (None, after)


def test_a_limit_ends_where_the_robot_turns_off_before_the_node() -> None:
    robot = leaving(0.3, None)
    robot.do(PoseReport(Pose(9.9, 0.9, 1.6, MAP), localized=True))
    assert limits(robot) == [0.3]
    robot.do(PoseReport(Pose(9.9, 1.1, 1.6, MAP), localized=True))
    assert limits(robot) == [0.3, None]


def test_a_limit_holds_on_the_rest_of_an_edge_at_whose_end_the_robot_has_stopped() -> None:
    robot = leaving(0.3, None, strategy=DriveStrategy.STOP_AT_NODES)
    robot.do(Arrived(robot.goal.generation))
    assert limits(robot) == [0.3]
    assert robot.goal.maximum_speed is None
    go(robot, 10.0)
    assert limits(robot) == [0.3, None]


def test_limits_of_several_short_edges_hold_until_each_is_left() -> None:
    robot = Bench(strategy=DriveStrategy.PASS_THROUGH, pass_radius=1.0)
    places = {
        name: position(x, radius=1.0) for name, x in (("n0", 0.0), ("n1", 5.0), ("n2", 5.5), ("n3", 15.0))
    }
    plain = order(*places, positions=places)
    speeds = zip(plain.edges, (0.2, 0.4, None), strict=True)
    edges = tuple(edge.model_copy(update={"maximum_speed": speed}) for edge, speed in speeds)
    robot.send(plain.model_copy(update={"edges": edges}))
    go(robot, 4.6)
    go(robot, 4.8)
    assert robot.state.last_node_id == "n2"
    go(robot, 5.1)
    go(robot, 5.6)
    assert limits(robot) == [0.2, 0.4, None]


def test_a_limit_of_an_edge_ends_on_another_map() -> None:
    robot = leaving(0.3, None)
    robot.do(PoseReport(Pose(9.6, 0.0, 0.0, "upstairs"), localized=True))
    assert limits(robot) == [0.3, None]


def test_a_robot_that_stops_at_the_node_is_not_slowed_down_before_it() -> None:
    robot = driving(strategy=DriveStrategy.STOP_AT_NODES)
    go(robot, 9.5)
    assert limits(robot) == []


def test_a_driver_without_speed_limits_gets_none() -> None:
    robot = Bench(strategy=DriveStrategy.PASS_THROUGH, limits_speed=False, maximum_speed=0.3)
    robot.send(slow_behind_n1())
    go(robot, 9.0)
    assert limits(robot) == []
