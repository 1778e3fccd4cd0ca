"""What is to stop directly after a restart, while a goal of before may still be driven to."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import Halted, VelocityReport
from nena_edge_agent.protocol.events import Halt, Started
from support.robot_core import Bench, action, at, order


def restarted() -> Bench:
    """Return a robot whose agent was killed on the way, and has heard nothing of the robot yet."""
    bench = Bench()
    bench.send(order("n0", "n1"))
    again = Bench(memory=bench.core.memory(), ready=False)
    again.do(Started())
    return again


@pytest.mark.parametrize("request_type", ["cancelOrder", "startPause"])
def test_a_stop_ends_an_earlier_goal_first(request_type: str) -> None:
    bench = restarted()
    bench.instant(action("a", "NONE", request_type))

    assert bench.effects_of(Halt)
    assert bench.status("a") == "RUNNING"
    bench.do(Halted())
    assert bench.status("a") == "FINISHED"


def test_an_earlier_goal_continues_until_the_robot_is_known_to_be_lost() -> None:
    bench = restarted()
    bench.do(VelocityReport(0.5, 0.0))
    assert not bench.effects_of(Halt)

    bench.do(at(3.0, localized=False))
    bench.do(at(3.0, localized=False))

    assert len(bench.effects_of(Halt)) == 1


def test_a_robot_with_an_earlier_goal_may_drive_until_odometry_arrives() -> None:
    bench = restarted()
    assert bench.state.driving
    bench.do(VelocityReport(0.0, 0.0))
    assert not bench.state.driving
