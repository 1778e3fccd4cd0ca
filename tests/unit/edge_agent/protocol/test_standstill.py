"""A robot that moves although its drive has ended: what waits until it stands, and what the state reports."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    GoalReport,
    GoalTable,
    HaltFailed,
    NavigationReport,
    PoseReport,
    VelocityReport,
)
from nena_edge_agent.protocol.actions import STANDSTILL_TIMEOUT
from nena_edge_agent.protocol.capabilities import DriveStrategy, ExternalGoals
from nena_edge_agent.protocol.conditions import EXTERNAL_GOAL, MOVES_WITHOUT_ORDER, ROBOT_NOT_STOPPED
from nena_edge_agent.protocol.driving import ROLL_OUT_TIME
from nena_edge_agent.protocol.events import (
    Event,
    Halt,
    OperatingModeSwitched,
    StartAction,
    Started,
    TimePassed,
)
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, at, order, restarted

ROLLS, STANDS, UNKNOWN = VelocityReport(1.0, 0.0), VelocityReport(0.0, 0.0), VelocityReport(None, None)
OPERATOR = GoalTable((GoalReport("rviz", external=True, status="EXECUTING"),))
NO_GOAL = GoalTable()


def arrives(bench: Bench, velocity: VelocityReport = ROLLS) -> None:
    """Make navigation report success while the robot moves."""
    goal = bench.goal
    bench.do(
        PoseReport(goal.pose, localized=True, vx=velocity.vx, omega=velocity.omega), Arrived(goal.generation)
    )


def started(bench: Bench) -> list[str]:
    return [each.action.action_id for each in bench.effects_of(StartAction)]


def later(bench: Bench, seconds: float) -> None:
    bench.now += seconds
    bench.do(TimePassed())


@pytest.mark.clause("6.2.2", "6.6.2/blocking")
@pytest.mark.parametrize("strategy", DriveStrategy)
@pytest.mark.parametrize("version", RULES)
@pytest.mark.parametrize("blocking", ["SOFT", "HARD"])
def test_an_action_that_blocks_driving_starts_when_the_robot_stands(
    version: str, strategy: DriveStrategy, blocking: str
) -> None:
    bench = Bench(rules=RULES[version], strategy=strategy)
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", blocking)]}))

    arrives(bench)

    assert (bench.status("a"), bench.state.driving, started(bench)) == ("WAITING", True, [])
    assert bench.state.last_node_id == "n1"
    assert bench.effects_of(Halt)
    bench.do(STANDS)
    assert not started(bench), "it may swing back"
    bench.halted()
    assert (started(bench), bench.state.driving) == (["a"], False)


@pytest.mark.clause("6.2.2")
@pytest.mark.parametrize("blocking", ["NONE", "SINGLE"])
def test_an_action_that_allows_driving_starts_at_once(blocking: str) -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", blocking)]}))
    arrives(bench)
    assert started(bench) == ["a"]
    assert not bench.effects_of(Halt)


@pytest.mark.clause("6.2.2", "6.2.2/edge")
def test_only_those_wait_that_need_standstill() -> None:
    bench = Bench()
    work = [action("n"), action("s", "SOFT"), action("h", "HARD")]
    bench.send(
        order("n0", "n1", "n2", node_actions={"n1": work}, edge_actions={"n1-n2": [action("e", "HARD")]})
    )
    arrives(bench)
    assert started(bench) == ["n"]
    bench.do(STANDS)
    bench.halted()
    assert started(bench) == ["n", "s"]
    bench.finishes("n")
    bench.do(ROLLS)
    bench.finishes("s")
    assert started(bench) == ["n", "s"], "an action has moved the robot, and it rolls out"
    bench.do(STANDS)
    bench.halted()
    bench.finishes("h")
    assert started(bench) == ["n", "s", "h", "e"]


def test_the_first_action_of_the_next_order_waits_until_the_last_drive_has_rolled_out() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    arrives(bench)
    bench.send(order("n1", order_id="next", node_actions={"n1": [action("a", "HARD")]}))
    assert bench.status("a") == "WAITING"
    bench.do(STANDS)
    bench.halted()
    assert started(bench) == ["a"]


def test_without_odometry_the_driver_decides_when_the_robot_stands() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD"), action("b", "HARD")]}))
    arrives(bench, UNKNOWN)
    assert not started(bench)
    bench.halted()
    assert started(bench) == ["a"]
    bench.finishes("a")
    assert started(bench) == ["a", "b"], "nothing has moved it since"


def test_without_odometry_the_stop_for_an_operators_goal_is_no_standstill() -> None:
    bench = Bench()
    bench.do(UNKNOWN)
    bench.send(order("n0", "n1"))
    bench.do(OPERATOR, DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "rviz"))
    bench.halted()  # the driver does not stop another program's drive
    bench.instant(action("i", "HARD"))
    bench.do(NO_GOAL)
    assert not started(bench), "it may roll out"
    bench.halted()
    assert started(bench) == ["i"]


@pytest.mark.clause("6.6.9")
def test_actions_fail_with_the_cause_if_the_robot_does_not_stop() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "SOFT"), action("b", "HARD")]}))
    arrives(bench)
    failed = HaltFailed("the odometry still shows 1.00 m/s")

    bench.do(failed)

    assert (bench.status("a"), bench.status("b")) == ("FAILED", "WAITING")
    assert "1.00 m/s" in str(bench.state.action_states[0].action_result)
    assert {"ACTION_FAILED", ROBOT_NOT_STOPPED} <= set(bench.errors)
    bench.do(failed)
    assert bench.status("b") == "FAILED"
    assert len(bench.goals) == 1, "it gets no goal while it cannot be stopped"
    bench.do(STANDS)
    bench.halted()
    assert len(bench.goals) == 2
    assert not started(bench)


def test_the_wait_is_limited_if_something_else_moves_the_robot() -> None:
    bench = Bench(external_goals=ExternalGoals.FAIL)
    bench.do(OPERATOR, ROLLS)
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    assert bench.waits()
    bench.halted()  # the driver does not stop another program's drive
    halts = len(bench.effects_of(Halt))
    later(bench, STANDSTILL_TIMEOUT - 0.1)
    assert bench.status("a") == "WAITING"
    later(bench, 0.2)
    assert bench.status("a") == "FAILED"
    assert "rviz" in str(bench.state.action_states[0].action_result)
    assert len(bench.effects_of(Halt)) == halts == 1
    assert not bench.waits()


@pytest.mark.clause("6.2.2")
def test_an_action_waits_for_an_operators_goal_as_the_order_does() -> None:
    bench = Bench()
    bench.do(OPERATOR, ROLLS)
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD")]}))
    assert bench.errors == [EXTERNAL_GOAL]
    later(bench, 100.0)
    assert bench.status("a") == "WAITING"
    bench.do(NO_GOAL, STANDS)
    bench.halted()
    assert (bench.status("a"), bench.errors) == ("INITIALIZING", [])


@pytest.mark.clause("6.1.3")
def test_a_cancel_ends_the_wait_for_standstill() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD")]}))
    arrives(bench)
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert (bench.status("a"), bench.status("c")) == ("FAILED", "RUNNING")
    bench.do(STANDS)
    bench.halted()
    assert (bench.status("c"), started(bench), bench.idle) == ("FINISHED", [], True)


@pytest.mark.clause("6.2.3/startPause")
def test_an_action_that_waits_for_standstill_waits_for_the_end_of_a_pause_too() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD")]}))
    arrives(bench)
    bench.instant(action("p", "NONE", "startPause"))
    bench.do(STANDS)
    bench.halted()
    assert (bench.status("p"), started(bench)) == ("FINISHED", [])
    bench.instant(action("s", "NONE", "stopPause"))
    assert started(bench) == ["a"]


@pytest.mark.clause("6.6/restart")
@pytest.mark.parametrize("running", [False, True], ids=["waiting", "running"])
def test_a_restarted_agent_waits_for_standstill(*, running: bool) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD")]}))
    arrives(bench)
    if running:
        bench.do(STANDS)
        bench.halted()
        bench.runs("a")

    again = restarted(bench)
    again.do(ROLLS)

    assert again.effects_of(Halt)
    assert not started(again)
    assert again.status("a") == ("INITIALIZING" if running else "WAITING")
    again.do(STANDS)
    again.halted()
    assert started(again) == ["a"]


@pytest.mark.clause("6.2.3/retry", "6.2.2")
def test_a_retried_action_waits_for_standstill() -> None:
    bench = Bench(rules=RULES["3.0.0"])
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD", retriable=True)]}))
    bench.runs("a")
    bench.fails("a")
    bench.do(ROLLS)
    bench.instant(action("r", "NONE", "retry", actionId="a"))
    assert started(bench) == ["a"]
    bench.do(STANDS)
    bench.halted()
    assert started(bench) == ["a", "a"]


# Instant actions


@pytest.mark.clause("6.2.1/blocking")
@pytest.mark.parametrize("blocking", ["SOFT", "HARD"])
def test_an_instant_action_that_blocks_driving_stops_the_drive_first(blocking: str) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(ROLLS)

    bench.instant(action("i", blocking))

    assert (bench.status("i"), started(bench), len(bench.effects_of(Halt))) == ("WAITING", [], 1)
    bench.do(STANDS)
    bench.halted()
    assert (started(bench), len(bench.goals)) == (["i"], 1)
    bench.runs("i")
    bench.finishes("i")
    assert len(bench.goals) == 2
    bench.arrive()
    assert bench.idle


@pytest.mark.clause("6.2.1/blocking")
@pytest.mark.parametrize("kind", ["stateRequest", "factsheetRequest"])
def test_instant_actions_that_move_nothing_do_not_stop_the_drive(kind: str) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("i", "HARD", kind))
    assert (bench.status("i"), bench.effects_of(Halt)) == ("FINISHED", [])


@pytest.mark.clause("6.2.1/blocking")
def test_an_instant_action_fails_if_the_robot_does_not_stop() -> None:
    bench = Bench()
    bench.do(ROLLS)
    bench.instant(action("i", "HARD"))
    bench.do(HaltFailed("the odometry still shows 1.00 m/s"))
    assert bench.status("i") == "FAILED"
    assert not started(bench)


@pytest.mark.clause("6.6.6", "6.2.1/blocking")
@pytest.mark.parametrize("mode", [OperatingMode.MANUAL, OperatingMode.INTERVENED, OperatingMode.SERVICE])
def test_an_instant_action_that_waits_does_not_start_under_a_persons_hands(mode: OperatingMode) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n0": [action("n")], "n1": [action("a", "HARD")]}))
    bench.do(ROLLS)
    bench.instant(action("i", "HARD"))

    bench.do(OperatingModeSwitched(mode), STANDS)
    bench.halted()

    assert (bench.status("i"), started(bench)) == ("FAILED", ["n"])
    assert f"in mode {mode}" in str([each.error_description for each in bench.state.errors])
    assert bench.status("a") == ("WAITING" if mode is OperatingMode.INTERVENED else "FAILED")


@pytest.mark.clause("6.6/restart", "6.2.1/blocking")
def test_an_instant_action_that_waits_ends_even_if_a_restarted_agent_no_longer_has_it() -> None:
    bench = Bench()
    bench.do(ROLLS)
    bench.instant(action("i", "HARD"))
    again = Bench(memory=bench.core.memory(), actions={})
    again.halted()
    assert started(again) == ["i"], "the runner fails it with the reason"


@pytest.mark.clause("6.6/restart", "6.2.1/blocking")
def test_a_restarted_agent_keeps_the_robot_standing_for_an_instant_action() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(ROLLS)
    bench.instant(action("i", "HARD"))
    again = restarted(bench)
    assert not again.goals
    again.halted()
    assert started(again) == ["i"]
    again.finishes("i")
    assert len(again.goals) == 1


# Failed drives, cancelOrder and startPause


FAILURES = pytest.mark.parametrize("failure", sorted(DriveFailure))
STOPS = pytest.mark.parametrize("kind", ["cancelOrder", "startPause"])


@pytest.mark.clause("6.1.3", "6.2.3/startPause")
@STOPS
@FAILURES
@pytest.mark.parametrize("retries", [0, 1])
def test_a_failed_drive_is_halted_and_no_stop_finishes_before_the_robot_stands(
    failure: DriveFailure, kind: str, retries: int
) -> None:
    bench = Bench(drive_retries=retries, external_goals=ExternalGoals.FAIL)
    bench.send(order("n0", "n1"))
    bench.do(ROLLS, DriveFailed(bench.goal.generation, failure, "code 0"))
    assert bench.effects_of(Halt)
    bench.instant(action("c", "NONE", kind))
    bench.do(HaltFailed("the odometry still shows 1.00 m/s"))
    assert bench.status("c") == "FAILED"

    bench.instant(action("d", "NONE", kind))
    assert bench.status("d") == "RUNNING"
    assert len(bench.effects_of(Halt)) == 2, "the driver is asked again, so that it answers"
    assert ROBOT_NOT_STOPPED in bench.errors
    bench.do(STANDS)
    bench.halted()
    assert bench.status("d") == "FINISHED" if kind == "startPause" else not bench.nodes
    assert ROBOT_NOT_STOPPED not in bench.errors


@pytest.mark.clause("6.1.3", "6.2.3/startPause")
@STOPS
def test_a_stop_halts_a_robot_that_moves_without_a_goal(kind: str) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", released=2))
    arrives(bench)
    bench.instant(action("c", "NONE", kind))
    assert (bench.status("c"), len(bench.effects_of(Halt))) == ("RUNNING", 1)
    bench.do(TimePassed(), ROLLS)
    assert len(bench.effects_of(Halt)) == 1
    bench.do(STANDS)
    bench.halted()
    assert bench.status("c") == "FINISHED"


@STOPS
def test_an_operators_drive_is_neither_halted_nor_waited_for(kind: str) -> None:
    bench = Bench()
    bench.do(OPERATOR, ROLLS)
    bench.send(order("n0", "n1"))
    bench.instant(action("c", "NONE", kind))
    assert (bench.status("c"), bench.effects_of(Halt)) == ("FINISHED", [])


@pytest.mark.clause("6.6.6")
@STOPS
def test_a_stop_does_not_wait_for_a_person_who_drives_the_robot(kind: str) -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.instant(action("p", "NONE", "startPause"))
    bench.do(OperatingModeSwitched(OperatingMode.INTERVENED), ROLLS)
    bench.halted()
    assert bench.status("p") == "FINISHED"
    halts = len(bench.effects_of(Halt))

    if kind == "cancelOrder":
        bench.instant(action("c", "NONE", kind))
        assert bench.status("c") == "FINISHED"

    assert len(bench.effects_of(Halt)) == halts
    assert bench.errors == []


def test_a_pause_waits_for_an_action_that_moves_the_robot_and_does_not_stop_it() -> None:
    bench = Bench()
    bench.send(order("n0", node_actions={"n0": [action("a", "HARD", "press")]}))
    bench.runs("a")
    bench.do(ROLLS)
    bench.instant(action("p", "NONE", "startPause"))
    assert (bench.status("p"), bench.effects_of(Halt)) == ("RUNNING", [])
    bench.do(STANDS)
    assert bench.status("p") == "FINISHED"


# A robot that moves without an order


def errors_after(bench: Bench, *events: Event) -> list[str]:
    """Return the errors a while after ``events``."""
    bench.do(*events)
    later(bench, ROLL_OUT_TIME + 0.1)
    return bench.errors


@pytest.mark.clause("6.6.5")
def test_a_robot_that_moves_without_an_order_needs_a_person_until_it_stands() -> None:
    bench = Bench()
    bench.do(ROLLS)
    assert (bench.errors, bench.waits()) == ([], True)
    later(bench, ROLL_OUT_TIME + 0.1)

    (error,) = bench.state.errors
    assert (error.error_type, error.error_level) == (MOVES_WITHOUT_ORDER, ErrorLevel.FATAL)
    assert "emergency stop" in str(error.error_hint)
    bench.do(UNKNOWN, OPERATOR, NO_GOAL)
    assert bench.errors == [MOVES_WITHOUT_ORDER]
    bench.do(STANDS)
    assert (bench.errors, bench.waits()) == ([], False)


@pytest.mark.parametrize("turns", [VelocityReport(0.0, 0.5), VelocityReport(-0.2, 0.0)])
def test_turning_and_reversing_are_movement_too(turns: VelocityReport) -> None:
    assert errors_after(Bench(), turns) == [MOVES_WITHOUT_ORDER]


def test_the_error_does_not_end_with_a_cancelled_order() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "code 0"))
    bench.halted()
    assert errors_after(bench, ROLLS) == ["NODE_UNREACHABLE", MOVES_WITHOUT_ORDER]
    bench.instant(action("c", "NONE", "cancelOrder"))
    bench.do(HaltFailed("the odometry still shows 1.00 m/s"))
    assert bench.status("c") == "FAILED"
    assert MOVES_WITHOUT_ORDER in bench.errors


@pytest.mark.parametrize(
    "reason",
    [
        [OPERATOR],
        [OperatingModeSwitched(OperatingMode.MANUAL)],
        [NavigationReport(available=False, reason="gone"), STANDS],
    ],
    ids=["operator's goal", "a person drives", "stands"],
)
def test_explained_movement_is_no_error(reason: list[Any]) -> None:
    assert MOVES_WITHOUT_ORDER not in errors_after(Bench(), ROLLS, *reason)


def test_a_drive_is_no_movement_without_an_order() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", released=2))
    assert errors_after(bench, ROLLS) == []
    arrives(bench)
    later(bench, ROLL_OUT_TIME - 1.0)
    bench.send(order("n1", "n2", update=1, first=2))
    assert errors_after(bench, ROLLS) == []
    again = restarted(bench)
    assert errors_after(again, Started(), at(12.0), ROLLS) == []
