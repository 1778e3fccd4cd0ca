"""Errors that last as long as their cause."""

from __future__ import annotations

from dataclasses import replace

import pytest

from nena_edge_agent.driver.port import (
    BlockedReport,
    CollisionReport,
    DriveLimits,
    DriveProgress,
    NavigationReport,
    Pose,
    PoseReport,
    SessionReport,
    SessionState,
)
from nena_edge_agent.protocol.conditions import (
    ACTION_PLUGIN_UNUSABLE,
    DEVIATION_TOO_SMALL,
    RECOVERY_REPORT_TIME,
    ROBOT_BLOCKED,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import (
    ErrorSwitched,
    Event,
    Halt,
    PauseAction,
    PauseButton,
    PluginsReport,
    ReportState,
    ResumeAction,
    SafetyReport,
    SendFactsheet,
    StartAction,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.own_actions import ROS_SESSION, START_ROS_SESSION, STOP_ROS_SESSION
from nena_shared.vda5050.state import EmergencyStop, OperatingMode
from support.robot_core import ACTIONS, MAP, Bench, action, at, order, position

STANDS = BlockedReport(blocked=True, seconds=20.0)


def test_a_blocked_robot_keeps_trying_and_reports_it() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    assert ReportState() in bench.do(STANDS)

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (ROBOT_BLOCKED, ErrorLevel.WARNING)
    assert "20 s" in str(error.error_description)
    assert bench.state.driving
    assert not bench.effects_of(Halt)
    bench.do(BlockedReport(blocked=False, seconds=20.0))
    assert bench.errors == []


def test_a_robot_without_an_order_is_not_blocked() -> None:
    bench = Bench()
    bench.do(STANDS)
    assert bench.errors == []


def test_the_state_explains_why_the_pose_is_unreliable() -> None:
    bench = Bench()
    bench.do(PoseReport(Pose(0.0, 0.0, 0.0, MAP), localized=False, problem="no pose for 7 s"))
    (error,) = bench.state.errors
    assert error.error_type == ErrorType.LOCALIZATION_ERROR
    assert "no pose for 7 s" in str(error.error_description)


def test_unusable_plug_ins_cause_a_warning_and_do_not_prevent_orders() -> None:
    bench = Bench()
    bench.do(PluginsReport(("plug-in 'lift' cannot be loaded", "plug-in 'forks' failed")))

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (ACTION_PLUGIN_UNUSABLE, ErrorLevel.WARNING)
    assert "plug-in 'lift' cannot be loaded; plug-in 'forks' failed" in str(error.error_description)
    bench.send(order("n0", "n1"))
    assert len(bench.goals) == 1


def broken(level: ErrorLevel) -> ErrorEntry:
    return ErrorEntry(error_type="bumper", error_level=level)


HINDRANCES: list[tuple[str, Event, Event]] = [
    ("emergency stop", SafetyReport(EmergencyStop.MANUAL), SafetyReport()),
    ("field violation", SafetyReport(field_violation=True), SafetyReport()),
    ("pause button", PauseButton(pressed=True), PauseButton(pressed=False)),
    (
        "critical error",
        ErrorSwitched(broken(ErrorLevel.CRITICAL), active=True),
        ErrorSwitched(broken(ErrorLevel.CRITICAL), active=False),
    ),
]
NAMES = [each[0] for each in HINDRANCES]


@pytest.mark.clause("6.6.5.1", "7.8/safety")
@pytest.mark.parametrize(("_", "begin", "end"), HINDRANCES, ids=NAMES)
def test_an_obstruction_stops_the_drive_and_its_end_resends_the_goal(
    _: str, begin: Event, end: Event
) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.do(begin)
    assert len(bench.effects_of(Halt)) == 1
    bench.halted()
    assert not bench.state.driving
    bench.do(end)

    assert [goal.generation for goal in bench.goals] == [1, 2]


@pytest.mark.clause("6.6.5.1", "7.8/safety")
@pytest.mark.parametrize(("_", "begin", "end"), HINDRANCES, ids=NAMES)
def test_an_obstruction_pauses_the_actions_that_can_be_paused(_: str, begin: Event, end: Event) -> None:
    bench = Bench()
    work = [action("a", "SOFT"), action("b", "SOFT", "press"), action("c", "HARD")]
    bench.send(order("n0", node_actions={"n0": work}))
    bench.runs("a", "b")

    bench.do(begin)
    assert [effect.action_id for effect in bench.effects_of(PauseAction)] == ["a"]
    bench.do(end)
    assert [effect.action_id for effect in bench.effects_of(ResumeAction)] == []  # it never said PAUSED


@pytest.mark.clause("6.6.5.1")
@pytest.mark.parametrize("level", [ErrorLevel.WARNING, ErrorLevel.URGENT])
def test_with_a_minor_error_the_robot_continues(level: ErrorLevel) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.do(ErrorSwitched(broken(level), active=True))

    assert (bench.errors, bench.effects_of(Halt)) == (["bumper"], [])
    bench.do(ErrorSwitched(broken(level), active=False))
    assert not bench.errors


@pytest.mark.clause("6.2.3/stopPause", "7.8/paused")
def test_the_pause_button_is_a_pause_that_fleet_control_cannot_end() -> None:
    bench = Bench()
    bench.do(PauseButton(pressed=True))
    assert bench.state.paused

    bench.instant(action("p", "NONE", "startPause"), action("s", "NONE", "stopPause"))
    assert bench.status("s") == "FAILED"
    bench.do(PauseButton(pressed=False))

    assert not bench.state.paused


@pytest.mark.clause("7.8/paused")
def test_a_pause_of_fleet_control_outlives_the_button() -> None:
    bench = Bench()
    bench.instant(action("p", "NONE", "startPause"))
    bench.do(PauseButton(pressed=True), PauseButton(pressed=False))

    assert bench.state.paused


@pytest.mark.clause("7.8/safety")
def test_the_state_shows_emergency_stop_and_field_at_once() -> None:
    bench = Bench()

    assert bench.do(SafetyReport(EmergencyStop.REMOTE, field_violation=True))

    safety = bench.state.safety_state
    assert (safety.active_emergency_stop, safety.field_violation) == (EmergencyStop.REMOTE, True)
    assert bench.state.operating_mode is OperatingMode.AUTOMATIC


STOP = ActionDeclaration(STOP_ROS_SESSION, (ActionScope.INSTANT,), needs_idle=True)
START = ActionDeclaration(START_ROS_SESSION, (ActionScope.INSTANT,))
NONE = NavigationReport(available=False, reason="its ROS session is not active")


def bench() -> Bench:
    made = Bench(actions={**ACTIONS, STOP.action_type: STOP, START.action_type: START})
    made.do(session(SessionState.ACTIVE))
    return made


def session(state: SessionState, reason: str = "") -> SessionReport:
    return SessionReport(state, "/r1", 7, reason)


def session_information(robot: Bench) -> dict[str, str]:
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
def test_an_order_waits_while_the_session_starts(state: SessionState) -> None:
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


def test_an_order_received_while_the_session_stops_is_refused() -> None:
    robot = bench()
    robot.instant(action("s1", action_type=STOP_ROS_SESSION))
    robot.send(order("n0", "n1"))
    assert robot.nodes == []
    assert robot.errors == ["MOBILE_ROBOT_NOT_AVAILABLE"]


def test_the_state_reports_each_change_of_the_session() -> None:
    robot = bench()
    assert session_information(robot) == {"state": "ACTIVE", "namespace": "/r1", "domainId": "7"}
    assert robot.do(session(SessionState.FAILED, "no network"))
    assert session_information(robot)["state"] == "FAILED"
    texts = [each.info_descriptor for each in robot.state.information or () if each.info_type == ROS_SESSION]
    assert texts == ["the ROS session is FAILED: no network"]
    assert robot.do(session(SessionState.FAILED, "no network")) == []


def test_a_robot_without_ros_reports_no_session() -> None:
    assert [each for each in Bench().state.information or () if each.info_type == ROS_SESSION] == []


def test_a_recovery_is_reported_for_a_while_after_it() -> None:
    robot = Bench()
    robot.send(order("n0", "n1"))
    robot.do(DriveProgress(5.0, 0, MAP))
    assert robot.errors == []

    robot.do(DriveProgress(5.0, 1, MAP))
    assert robot.errors == ["DRIVE_RECOVERS"]
    robot.now += RECOVERY_REPORT_TIME + 1.0
    robot.do(DriveProgress(4.0, 1, MAP))
    assert robot.errors == []


def test_the_collision_monitor_is_reported_only_during_a_drive() -> None:
    robot = Bench()
    robot.do(CollisionReport(stops=True, polygon="Front"))
    assert robot.errors == []

    robot.send(order("n0", "n1"))
    assert robot.errors == ["COLLISION_STOP"]
    robot.do(CollisionReport(stops=False, polygon=""))
    assert robot.errors == []


LIMITS = DriveLimits(tolerance=0.25, hand_over=0.6, map_id=MAP, theta_tolerance=0.25)


EXACT = position(20.0, theta=1.0).model_copy(update={"allowed_deviation_theta": 0.1})


@pytest.mark.parametrize(
    ("place", "theta_tolerance", "text", "parameter"),
    [
        (position(20.0, radius=0.1), 0.25, "0.1 m, but Nav2's goal tolerance is 0.25 m", "xy_goal_tolerance"),
        (position(20.0, radius=0.25), 0.25, "", ""),
        (EXACT, 0.25, "0.1 rad, but Nav2's goal tolerance is 0.25 rad", "yaw_goal_tolerance"),
        (EXACT, 0.1, "", ""),
        (EXACT, None, "", ""),
    ],
)
def test_a_deviation_below_the_goal_tolerance_is_reported_before_the_drive(
    place: NodePosition, theta_tolerance: float | None, text: str, parameter: str
) -> None:
    bench = Bench()
    bench.do(replace(LIMITS, theta_tolerance=theta_tolerance))
    bench.send(order("n0", "n1", "n2", positions={"n2": place}))

    assert bench.errors == ([DEVIATION_TOO_SMALL] if text else [])
    for entry in bench.state.errors:
        assert entry.error_level is ErrorLevel.WARNING
        assert f"'n2' allows a deviation of {text}" in str(entry.error_description)
        assert parameter in str(entry.error_hint)


def test_new_limits_of_navigation_are_published_once() -> None:
    bench = Bench()
    assert SendFactsheet() in bench.do(LIMITS)
    assert SendFactsheet() not in bench.do(LIMITS)
