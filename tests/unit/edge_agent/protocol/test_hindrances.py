"""What a person at the robot or the world does: it holds the robot (sections 6.2.3, 6.6.5.1 and 7.8)."""

from __future__ import annotations

import pytest

from nena_edge_agent.protocol.events import (
    ErrorSwitched,
    Event,
    Halt,
    PauseAction,
    PauseButton,
    ResumeAction,
    SafetyReport,
)
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import EmergencyStop, OperatingMode
from support.robot_core import Bench, action, order


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
def test_a_hindrance_stops_the_drive_and_its_end_gives_the_goal_again(
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
def test_a_hindrance_holds_the_actions_that_can_be_held(_: str, begin: Event, end: Event) -> None:
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
def test_with_a_small_error_the_robot_goes_on(level: ErrorLevel) -> None:
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
