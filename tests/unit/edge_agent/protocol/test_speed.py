"""The robot slows down before an edge with a lower limit, where it passes the node before it."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import Pose, PoseReport
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import LimitSpeed
from nena_shared.vda5050.order import Order
from support.robot_core import MAP, Bench, order


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


def test_a_robot_that_stops_at_the_node_is_not_slowed_down_before_it() -> None:
    robot = driving(strategy=DriveStrategy.STOP_AT_NODES)
    go(robot, 9.5)
    assert limits(robot) == []


def test_a_driver_without_speed_limits_gets_none() -> None:
    robot = Bench(strategy=DriveStrategy.PASS_THROUGH, limits_speed=False, maximum_speed=0.3)
    robot.send(slow_behind_n1())
    go(robot, 9.0)
    assert limits(robot) == []
