"""A robot whose standstill is not confirmed: the state reports it, and an error asks for a person."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import (
    DriveFailed,
    DriveFailure,
    Halted,
    HaltFailed,
    NavigationReport,
    VelocityReport,
)
from nena_edge_agent.protocol.conditions import ROBOT_NOT_STOPPED
from nena_edge_agent.protocol.events import Halt
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from support.robot_core import Bench, action, order

ROLLS = HaltFailed("the odometry still shows 0.50 m/s")


@pytest.mark.clause("6.1.3", "6.2.3")
@pytest.mark.parametrize("kind", ["cancelOrder", "startPause"])
def test_actions_that_require_a_stop_fail_and_never_finish(bench: Bench, kind: str) -> None:
    bench.instant(action("a", "NONE", kind))
    assert bench.status("a") == "RUNNING"

    bench.do(ROLLS)

    state = bench.state
    assert (bench.status("a"), state.driving) == ("FAILED", True)
    (error,) = state.errors
    assert (error.error_type, error.error_level) == (ROBOT_NOT_STOPPED, ErrorLevel.FATAL)
    assert "0.50 m/s" in str(error.error_description)
    assert "emergency stop" in str(error.error_hint)

    bench.do(Halted())

    assert (bench.status("a"), bench.state.driving, bench.errors) == ("FAILED", False, [])
    assert bool(bench.nodes) is (kind == "startPause"), "a cancelled order is cleared once it stands"


def test_a_second_cancel_stops_the_robot_again(bench: Bench) -> None:
    bench.instant(action("c1", "NONE", "cancelOrder"))
    bench.do(ROLLS)
    effects = bench.instant(action("c2", "NONE", "cancelOrder"))
    assert Halt() in effects
    assert bench.status("c2") == "RUNNING"
    bench.do(ROLLS)
    assert bench.status("c2") == "FAILED"


def test_a_robot_whose_halt_is_not_confirmed_gets_no_goal(bench: Bench) -> None:
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.NAVIGATION_GONE, "gone"), ROLLS)
    bench.send(order("n1", "n2", update=1, first=2))
    assert len(bench.goals) == 1
    bench.do(Halted())
    assert ROBOT_NOT_STOPPED not in bench.errors


def test_a_drive_without_navigation_is_stopped_and_reported_as_driving_until_then(bench: Bench) -> None:
    effects = bench.do(DriveFailed(bench.goal.generation, DriveFailure.NAVIGATION_GONE, "gone"))
    assert Halt() in effects
    assert (bench.state.driving, bench.errors) == (True, [ErrorType.NODE_UNREACHABLE])
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "RUNNING"
    bench.do(Halted())
    assert (bench.status("c"), bench.state.driving) == ("FINISHED", False)


def test_driving_and_velocity_follow_the_odometry() -> None:
    idle = Bench()
    told = []
    for velocity in (VelocityReport(0.3, 0.0), VelocityReport(0.0, 0.005), VelocityReport(None, None)):
        idle.do(velocity)
        told.append((idle.state.driving, idle.state.velocity and idle.state.velocity.vx))
    assert told == [(True, 0.3), (False, 0.0), (False, None)]


@pytest.mark.parametrize(("vx", "driving"), [(0.0, False), (0.3, True), (None, True)])
def test_a_robot_whose_goal_waits_for_navigation_drives_only_while_it_moves(
    bench: Bench, *, vx: float | None, driving: bool
) -> None:
    bench.do(VelocityReport(vx, vx))
    assert bench.state.driving
    bench.do(NavigationReport(available=False, reason="behavior_server is not active"))
    assert bench.state.driving is driving
    bench.do(NavigationReport(available=True, reason=""))
    assert bench.state.driving
