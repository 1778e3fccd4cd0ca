"""What the ROS session's state does to orders, and what the state says of it."""

from __future__ import annotations

import pytest

from nena_edge_agent.driver.port import NavigationReport, SessionReport
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import StartAction
from nena_edge_agent.ros.session_state import SessionState
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.own_actions import ROS_SESSION, START_ROS_SESSION, STOP_ROS_SESSION
from support.robot_core import ACTIONS, Bench, action, at, order

STOP = ActionDeclaration(STOP_ROS_SESSION, (ActionScope.INSTANT,), needs_idle=True)
START = ActionDeclaration(START_ROS_SESSION, (ActionScope.INSTANT,))
NONE = NavigationReport(available=False, reason="its ROS session is not active")


def bench() -> Bench:
    made = Bench(actions={**ACTIONS, STOP.action_type: STOP, START.action_type: START})
    made.do(session(SessionState.ACTIVE))
    return made


def session(state: SessionState, reason: str = "") -> SessionReport:
    return SessionReport(state, "/r1", 7, reason)


def told(robot: Bench) -> dict[str, str]:
    (information,) = (each for each in robot.state.information or () if each.info_type == ROS_SESSION)
    return {each.reference_key: each.reference_value for each in information.info_references}


@pytest.mark.parametrize("off", [SessionState.NOT_ACTIVE, SessionState.TERMINATING])
def test_an_order_is_refused_while_the_session_is_off(off: SessionState) -> None:
    robot = bench()
    robot.do(session(off), NONE, at(0.0, localized=False))
    assert robot.errors == ["NAVIGATION_NOT_AVAILABLE"]

    robot.send(order("n0", "n1"))
    assert robot.nodes == []
    assert robot.errors == ["NAVIGATION_NOT_AVAILABLE", "MOBILE_ROBOT_NOT_AVAILABLE"]

    robot.do(session(SessionState.ACTIVE), at(0.0), NavigationReport(available=True, reason=""))
    assert robot.errors == []
    robot.send(order("n0", "n1"))
    assert robot.nodes == ["n1"]


@pytest.mark.parametrize("state", [SessionState.INITIATING, SessionState.FAILED])
def test_an_order_waits_while_the_session_starts_or_is_about_to(state: SessionState) -> None:
    robot = bench()
    robot.do(session(state, "no network"), NavigationReport(available=False, reason="no session"))
    robot.send(order("n0", "n1"))
    assert robot.nodes == ["n1"]
    assert robot.goals == []
    robot.do(session(SessionState.ACTIVE), NavigationReport(available=True, reason=""))
    assert len(robot.goals) == 1


def test_the_session_is_not_stopped_while_an_order_is_active() -> None:
    robot = bench()
    robot.send(order("n0", "n1"))
    robot.instant(action("s1", action_type=STOP_ROS_SESSION))
    assert robot.status("s1") == "FAILED"
    (error,) = robot.state.errors
    assert "order 'o1' is active" in (error.error_description or "")
    assert robot.effects_of(StartAction) == []


def test_the_session_may_be_started_while_an_order_is_active() -> None:
    robot = bench()
    robot.send(order("n0", "n1"))
    robot.instant(action("s1", action_type=START_ROS_SESSION))
    assert [effect.action.action_id for effect in robot.effects_of(StartAction)] == ["s1"]


def test_an_order_that_comes_while_the_session_is_being_stopped_is_refused() -> None:
    robot = bench()
    robot.instant(action("s1", action_type=STOP_ROS_SESSION))
    robot.send(order("n0", "n1"))
    assert robot.nodes == []
    assert robot.errors == ["MOBILE_ROBOT_NOT_AVAILABLE"]


def test_the_state_tells_of_the_session_at_each_change() -> None:
    robot = bench()
    assert told(robot) == {"state": "ACTIVE", "namespace": "/r1", "domainId": "7"}
    assert robot.do(session(SessionState.FAILED, "no network"))
    assert told(robot)["state"] == "FAILED"
    texts = [each.info_descriptor for each in robot.state.information or () if each.info_type == ROS_SESSION]
    assert texts == ["the ROS session is FAILED: no network"]
    assert robot.do(session(SessionState.FAILED, "no network")) == []


def test_a_robot_without_ros_tells_of_no_session() -> None:
    assert [each for each in Bench().state.information or () if each.info_type == ROS_SESSION] == []
