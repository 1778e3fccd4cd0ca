"""Driving along an order: pictures of section 6.6.2, strategies, failures, what keeps a robot standing."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveLimits,
    GoalReport,
    GoalTable,
    Halted,
    NavigationReport,
    Pose,
    PoseReport,
)
from nena_edge_agent.protocol.capabilities import DriveStrategy, ExternalGoals, LinkLossPolicy
from nena_edge_agent.protocol.conditions import DRIVE_RETRIED, EXTERNAL_GOAL
from nena_edge_agent.protocol.driving import POSES_AHEAD, TRANSIENT_WAIT
from nena_edge_agent.protocol.events import Drive, Halt, LinkReport, StartAction, Started, TimePassed
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from support.robot_core import MAP, Bench, action, at, order, position

PASS: dict[str, Any] = {"strategy": DriveStrategy.PASS_THROUGH}
GONE = NavigationReport(available=False, reason="Nav2 is not active")
BACK = NavigationReport(available=True, reason="")


def lost_at(x: float) -> PoseReport:
    return at(x, localized=False)


@pytest.mark.clause("6.6.2", "6.6.2/first")
def test_an_order_is_driven_node_by_node_to_its_end() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    assert bench.state.driving
    assert bench.goal.pose == Pose(10.0, 0.0, 0.0, MAP)

    bench.arrive()
    assert (bench.state.last_node_id, bench.state.last_node_sequence_id) == ("n1", 2)
    assert (bench.nodes, bench.edges) == (["n2"], ["n1-n2"])

    bench.arrive()
    assert (bench.state.last_node_id, bench.nodes, bench.edges) == ("n2", [], [])
    assert [goal.generation for goal in bench.goals] == [1, 2]
    assert bench.idle
    assert not bench.state.driving


@pytest.mark.clause("7.3/deviation", "7.3/theta", "7.3/speed")
def test_a_goal_has_the_requirements_of_node_and_edge() -> None:
    bench = Bench()
    place = position(10.0, 5.0, theta=1.5, radius=0.2).model_copy(update={"allowed_deviation_theta": 0.1})
    bench.send(order("n0", "n1", positions={"n1": place}, edge_fields={"maximum_speed": 0.5}))

    assert bench.goal.pose == Pose(10.0, 5.0, 1.5, MAP)
    assert (bench.goal.deviation_xy, bench.goal.deviation_theta) == (0.2, 0.1)
    assert bench.goal.maximum_speed == 0.5


@pytest.mark.clause("7.3/theta")
def test_without_a_theta_the_robot_faces_its_direction_of_travel_and_any_heading_fits() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", positions={"n1": position(0.0, 5.0)}))

    assert bench.goal.pose.theta == pytest.approx(1.5708, abs=1e-3)
    assert bench.goal.deviation_theta is None


def picture(blocking: str) -> Bench:
    """Bring the robot to the moment before n2 of the order e1, n2, e3 with an action on each."""
    bench = Bench()
    bench.send(
        order(
            "n0",
            "n2",
            "n4",
            edge_actions={"n0-n2": [action("e1", "NONE", "lamp")], "n2-n4": [action("e3", "NONE", "lamp")]},
            node_actions={"n2": [action("a2", blocking)]},
        )
    )
    bench.runs("e1")
    assert (bench.nodes, bench.edges) == (["n2", "n4"], ["n0-n2", "n2-n4"])
    assert bench.statuses() == {"e1": "RUNNING", "a2": "WAITING", "e3": "WAITING"}
    return bench


@pytest.mark.clause("6.6.2", "6.2.2/edge")
def test_a_node_action_that_does_not_block_driving() -> None:
    bench = picture("NONE")

    effects = bench.arrive()

    assert (bench.nodes, bench.edges) == (["n4"], ["n2-n4"])
    assert bench.statuses() == {"e1": "FINISHED", "a2": "INITIALIZING", "e3": "INITIALIZING"}
    assert sum(isinstance(effect, Drive) for effect in effects) == 1


@pytest.mark.clause("6.6.2", "6.6.2/blocking")
@pytest.mark.parametrize("blocking", ["SOFT", "HARD"])
def test_a_node_action_that_blocks_driving(blocking: str) -> None:
    bench = picture(blocking)

    effects = bench.arrive()

    assert (bench.nodes, bench.edges) == (["n4"], ["n2-n4"])
    assert bench.statuses() == {"e1": "FINISHED", "a2": "INITIALIZING", "e3": "WAITING"}
    assert not any(isinstance(effect, Drive) for effect in effects)

    effects = bench.finishes("a2")

    assert bench.statuses() == {"e1": "FINISHED", "a2": "FINISHED", "e3": "INITIALIZING"}
    assert any(isinstance(effect, Drive) for effect in effects)


@pytest.mark.clause("6.2.2/edge")
def test_a_blocking_action_of_an_edge_runs_before_the_robot_moves_on_it() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [action("e", "HARD")]}))
    assert bench.status("e") == "INITIALIZING"
    assert not bench.goals

    bench.finishes("e")

    assert len(bench.goals) == 1


@pytest.mark.clause("6.2.2/edge")
def test_an_edge_action_that_has_not_finished_fails_when_its_edge_ends() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [action("e")]}))
    bench.runs("e")

    bench.arrive()

    assert bench.status("e") == "FAILED"
    assert bench.errors == [ErrorType.ACTION_FAILED]
    assert bench.state.errors[0].error_level is ErrorLevel.WARNING


@pytest.mark.clause("6.6.2/decision", "6.6.8")
def test_the_robot_stops_at_its_decision_point_and_continues_when_the_base_is_extended() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", released=2))
    bench.arrive()
    assert len(bench.goals) == 1
    assert not bench.idle

    bench.send(order("n1", "n2", update=1, first=2))

    assert bench.goal.pose.x == 20.0


@pytest.mark.clause("6.1.2/zero")
def test_an_edge_without_length_is_traversed_at_standstill() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", released=1))

    bench.send(
        order("n0", "n9", update=1, positions={"n9": position(0.0)}, node_actions={"n9": [action("new")]})
    )

    assert (bench.state.last_node_id, bench.state.last_node_sequence_id) == ("n9", 2)
    assert bench.status("new") == "INITIALIZING"
    assert not bench.goals


@pytest.mark.parametrize("late", [Arrived(generation=1), DriveFailed(1, DriveFailure.ABORTED, "superseded")])
def test_a_late_answer_about_an_older_goal_is_ignored(late: Arrived | DriveFailed) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    bench.arrive()

    assert bench.do(late) == []
    assert (bench.nodes, bench.state.driving) == (["n2"], True)


@pytest.mark.clause("6.6.2/range")
def test_pass_through_sends_the_next_goal_within_the_range_of_a_node() -> None:
    bench = Bench(**PASS)
    bench.send(order("n0", "n1", "n2", positions={"n1": position(10.0, radius=0.4)}))
    bench.do(at(9.5))
    assert bench.nodes == ["n1", "n2"]

    bench.do(at(9.7))

    assert bench.nodes == ["n2"]
    assert bench.goal.pose.x == 20.0
    assert not bench.effects_of(Halt)


@pytest.mark.parametrize(("speed", "given_at"), [(0.0, 9.55), (0.5, 9.3), (1.0, 8.8), (4.0, 7.1)])
def test_the_next_goal_is_sent_earlier_at_higher_speed(speed: float, given_at: float) -> None:
    """Goal tolerance and the way of a replanning period before the node, but within its deviation."""
    bench = Bench(**PASS, pass_radius=0.5, hand_over_distance=0.25, hand_over_time=1.0)
    bench.send(order("n0", "n1", "n2", positions={"n1": position(10.0, radius=3.0)}))
    for x, nodes in ((given_at - 0.11, ["n1", "n2"]), (given_at, ["n2"])):
        bench.do(PoseReport(Pose(x, 0.0, 0.0, MAP), localized=True, vx=speed, omega=0.0))
        assert bench.nodes == nodes


def test_the_limits_of_navigation_determine_when_the_next_goal_is_sent() -> None:
    bench = Bench(**PASS, pass_radius=0.5, hand_over_distance=0.25, hand_over_time=1.0)
    bench.do(DriveLimits(tolerance=0.25, hand_over=0.6, map_id=MAP))
    bench.send(order("n0", "n1", "n2", positions={"n1": position(10.0, radius=3.0)}))
    for x, nodes in ((8.85, ["n1", "n2"]), (8.95, ["n2"])):
        bench.do(PoseReport(Pose(x, 0.0, 0.0, MAP), localized=True, vx=0.5, omega=0.0))
        assert bench.nodes == nodes


@pytest.mark.clause("6.6.2/range", "6.6.2/decision", "7.3/theta")
@pytest.mark.parametrize(
    "reason",
    [
        {"node_actions": {"n1": [action("a", "SOFT")]}},
        {"edge_actions": {"n1-n2": [action("a", "HARD")]}},
        {"positions": {"n1": position(10.0, theta=3.0)}},
        {"released": 2},
    ],
    ids=["node action", "action of the next edge", "heading", "end of the base"],
)
def test_a_node_with_a_reason_to_stop_is_not_passed(reason: dict[str, Any]) -> None:
    bench = Bench(**PASS)
    bench.send(order("n0", "n1", "n2", **reason))

    bench.do(at(10.0))

    assert bench.nodes == ["n1", "n2"]
    bench.arrive()
    assert bench.nodes == ["n2"]


@pytest.mark.clause("6.6.2/decision")
def test_an_update_in_time_lets_the_robot_pass_its_old_decision_point() -> None:
    bench = Bench(**PASS)
    bench.send(order("n0", "n1", "n2", released=2))
    bench.do(at(8.0))
    bench.send(order("n1", "n2", update=1, first=2))

    bench.do(at(9.9))

    assert bench.goal.pose.x == 20.0
    assert not bench.effects_of(Halt)


@pytest.mark.clause("6.6.5.1/keeps", "6.6.5.4/unreachable", "6.6.5.2", "6.6.5.3")
@pytest.mark.parametrize("failure", sorted(set(DriveFailure) - {DriveFailure.TAKEN_OVER}))
def test_a_failed_drive_is_an_error_and_the_node_is_not_traversed(failure: DriveFailure) -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))

    bench.do(DriveFailed(bench.goal.generation, failure, "no way"))

    state = bench.state
    assert (state.last_node_id, bench.nodes, bench.edges) == ("n0", ["n1", "n2"], ["n0-n1", "n1-n2"])
    assert state.driving, "it may drive on until the driver confirms its standstill"
    (error,) = state.errors
    assert (error.error_type, error.error_level) == (ErrorType.NODE_UNREACHABLE, ErrorLevel.CRITICAL)
    assert "no way" in str(error.error_description)
    assert error.error_hint
    assert {"nodeId": "n1", "failure": failure.value}.items() <= {
        each.reference_key: each.reference_value for each in error.error_references
    }.items()
    bench.do(at(1.0), TimePassed())
    assert len(bench.goals) == 1
    bench.halted()
    assert not bench.state.driving
    assert len(bench.goals) == 1


@pytest.mark.clause("6.6.5.1/keeps")
def test_an_update_retries_a_failed_drive() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2", released=2))
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "no way"), Halted())

    bench.send(order("n1", "n2", update=1, first=2))

    assert len(bench.goals) == 2
    assert not bench.errors
    bench.arrive()
    assert bench.state.last_node_id == "n1"


def test_no_goal_is_sent_while_navigation_is_missing() -> None:
    bench = Bench()
    bench.do(GONE)
    bench.send(order("n0", "n1"))
    assert not bench.goals
    assert bench.errors == [ErrorType.NAVIGATION_NOT_AVAILABLE]
    assert "Nav2 is not active" in str(bench.state.errors[0].error_description)

    bench.do(BACK)
    assert len(bench.goals) == 1
    assert not bench.errors


def test_the_goal_is_resent_when_navigation_returns() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.do(GONE)
    assert bench.errors == [ErrorType.NAVIGATION_NOT_AVAILABLE]
    bench.do(BACK)

    assert [goal.generation for goal in bench.goals] == [1, 2]
    assert bench.goals[0].pose == bench.goals[1].pose


@pytest.mark.clause("6.6.5.4/localisation")
def test_a_robot_without_a_position_stops_and_continues_once_localised() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))

    bench.do(lost_at(3.0))
    assert len(bench.effects_of(Halt)) == 1
    assert bench.errors == [ErrorType.LOCALIZATION_ERROR]
    assert bench.state.errors[0].error_level is ErrorLevel.FATAL
    assert bench.nodes == ["n1"]

    bench.halted()
    assert len(bench.goals) == 1
    bench.do(at(3.0))
    assert len(bench.goals) == 2
    assert not bench.errors


def test_an_unanswered_halt_is_repeated() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(lost_at(3.0))
    assert bench.waits()

    bench.now += 4.9
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 1
    bench.now += 0.2
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 2

    bench.halted()
    assert not bench.waits()


@pytest.mark.clause("6.6.3")
def test_a_new_base_is_requested_near_the_end_of_the_current_one() -> None:
    bench = Bench(base_request_distance=3.0)
    bench.send(order("n0", "n1", "n2", released=2))
    assert not bench.asks_for_base()

    bench.do(at(6.9))
    assert not bench.asks_for_base()
    bench.do(at(7.1))
    assert bench.asks_for_base()

    bench.send(order("n1", "n2", update=1, first=2))
    assert not bench.asks_for_base()


@pytest.mark.clause("6.6.3")
@pytest.mark.parametrize(
    ("strategy", "asks_at"), [(DriveStrategy.STOP_AT_NODES, 8.0), (DriveStrategy.PASS_THROUGH, 5.9)]
)
def test_a_robot_that_passes_nodes_requests_its_base_before_navigation_replans(
    strategy: DriveStrategy, asks_at: float
) -> None:
    bench = Bench(strategy=strategy, maximum_speed=1.0, base_request_time=3.5)
    bench.do(DriveLimits(0.25, 0.6, MAP))
    bench.send(order("n0", "n1", "n2", released=2))
    bench.do(at(asks_at - 0.1))
    assert not bench.asks_for_base()
    bench.do(at(asks_at + 0.1))
    assert bench.asks_for_base()


@pytest.mark.clause("6.6.3", "6.1.2/B6")
def test_at_the_end_of_the_base_a_new_base_is_requested_only_with_a_horizon() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", released=1))
    assert bench.asks_for_base()

    bench.send(order("n0", update=1))
    assert not bench.asks_for_base()
    assert bench.idle


@pytest.mark.clause("6.1.2/stitching")
def test_actions_of_the_stitching_node_do_not_run_again() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", node_actions={"n1": [action("a", "HARD")]}))
    bench.arrive()
    bench.finishes("a")

    bench.send(order("n1", "n2", update=1, first=2, node_actions={"n1": [action("a", "HARD")]}))

    assert bench.statuses() == {"a": "FINISHED"}
    assert len(bench.effects_of(StartAction)) == 1


@pytest.mark.clause("6.1.2/B6")
def test_an_action_moved_from_horizon_to_base_keeps_its_state_and_others_are_removed() -> None:
    bench = Bench()
    bench.send(
        order("n0", "n1", "n2", released=1, node_actions={"n1": [action("kept")], "n2": [action("gone")]})
    )
    assert bench.statuses() == {"kept": "WAITING", "gone": "WAITING"}

    bench.send(order("n0", "n1", update=1, node_actions={"n1": [action("kept")]}))

    assert bench.statuses() == {"kept": "WAITING"}


@pytest.mark.clause("6.1.2/zero")
def test_an_edge_without_length_is_driven_by_a_robot_that_is_elsewhere() -> None:
    """The first node may allow a large deviation; the next one at the same place need not."""
    bench = Bench()
    far = position(4.0, radius=5.0)
    bench.send(order("n0", "n1", positions={"n0": far, "n1": position(4.0)}))

    assert bench.nodes == ["n1"]
    assert bench.goal.pose.x == 4.0


@pytest.mark.clause("6.1.2/zero", "7.3/theta")
@pytest.mark.parametrize(("theta", "driven"), [(0.2, False), (1.5, True)], ids=["as required", "off it"])
def test_an_edge_without_length_is_driven_by_a_robot_off_the_required_heading(
    theta: float,
    driven: bool,  # noqa: FBT001
) -> None:
    """The first node is traversed with any heading; the next one at the same place is not."""
    bench = Bench()
    bench.do(at(0.0, theta=theta))
    facing = position(0.0, theta=0.0)
    bench.send(order("n0", "n1", positions={"n0": facing, "n1": facing}))

    assert [goal.pose for goal in bench.goals] == [Pose(0.0, 0.0, 0.0, MAP)] * driven
    assert bench.nodes == ["n1"] * driven


def test_the_hint_is_correct_after_a_failure_of_navigation_during_a_drive() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    bench.do(NavigationReport(available=False, reason="gone"))
    assert "automatically" in str(bench.state.errors[-1].error_hint)

    bench.do(DriveFailed(bench.goal.generation, DriveFailure.NAVIGATION_GONE, "gone"))
    (hint,) = (
        each.error_hint
        for each in bench.state.errors
        if each.error_type == ErrorType.NAVIGATION_NOT_AVAILABLE
    )
    bench.do(NavigationReport(available=True, reason=""))

    assert "send an order update" in str(hint)
    assert len(bench.goals) == 1


@pytest.fixture
def bench() -> Bench:
    bench = Bench(drive_retries=2, retry_wait=5.0)
    bench.send(order("n0", "n1", "n2"))
    return bench


def fail(bench: Bench, failure: DriveFailure = DriveFailure.ABORTED) -> None:
    """Make the drive fail; the robot stops."""
    bench.do(DriveFailed(bench.goal.generation, failure, "no way"), Halted())


def later(bench: Bench, seconds: float) -> None:
    bench.now += seconds
    bench.do(TimePassed())


@pytest.mark.clause("6.6.5.1/keeps")
def test_a_drive_is_retried_after_a_delay_and_fails_after_the_last_retry(bench: Bench) -> None:
    for number in (1, 2):
        fail(bench)
        (error,) = bench.state.errors
        assert (error.error_type, error.error_level) == (DRIVE_RETRIED, ErrorLevel.WARNING)
        assert f"try {number} of 2" in str(error.error_description)
        assert "no way (ABORTED)" in str(error.error_description)
        assert bench.waits()
        later(bench, 4.9)
        assert len(bench.goals) == number
        later(bench, 0.2)
        assert len(bench.goals) == number + 1
        assert bench.errors == [DRIVE_RETRIED]
        assert not bench.waits()

    fail(bench)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]
    later(bench, 60.0)
    assert len(bench.goals) == 3


def test_the_next_node_has_its_own_retries(bench: Bench) -> None:
    fail(bench)
    later(bench, 5.0)
    bench.arrive()
    assert bench.errors == []
    for _ in range(2):
        fail(bench)
        later(bench, 5.0)
    assert (bench.errors, bench.goal.pose.x) == ([DRIVE_RETRIED], 20.0)


@pytest.mark.parametrize("failure", [DriveFailure.CANCELED_FROM_OUTSIDE])
def test_a_cancelled_or_replaced_goal_is_not_retried(bench: Bench, failure: DriveFailure) -> None:
    fail(bench, failure)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]


def test_an_order_that_waits_for_a_retry_can_be_cancelled(bench: Bench) -> None:
    fail(bench)
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert (bench.status("c"), bench.errors) == ("FINISHED", [])
    later(bench, 10.0)
    assert len(bench.goals) == 1


def test_a_drive_is_retried_when_its_navigation_returns(bench: Bench) -> None:
    bench.do(NavigationReport(available=False, reason="gone"))
    fail(bench, DriveFailure.NAVIGATION_GONE)
    assert Halt() in bench.effects
    later(bench, 60.0)
    assert len(bench.goals) == 1
    bench.do(NavigationReport(available=True, reason=""))
    assert (len(bench.goals), bench.errors) == (2, [DRIVE_RETRIED])


def interrupted(bench: Bench) -> None:
    """Make the drive fail for a reason that passes; the robot stops."""
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "no reason", transient=True), Halted())


@pytest.mark.clause("6.6.5.1/keeps")
def test_a_drive_that_a_transient_cause_ends_is_retried_three_times_without_any_setting() -> None:
    bench = Bench(retry_wait=5.0)
    bench.send(order("n0", "n1", "n2"))
    for number in (1, 2, 3):
        interrupted(bench)
        (error,) = bench.state.errors
        assert error.error_type == DRIVE_RETRIED
        assert f"retry {number} of 3" in str(error.error_description)
        later(bench, 5.0)
        assert len(bench.goals) == number + 1

    interrupted(bench)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]
    later(bench, 60.0)
    assert len(bench.goals) == 4


def test_a_real_failure_after_a_transient_one_fails_at_once() -> None:
    bench = Bench(retry_wait=5.0)
    bench.send(order("n0", "n1"))
    interrupted(bench)
    later(bench, 5.0)
    fail(bench)
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]


def test_more_retries_than_three_also_count_for_a_transient_cause() -> None:
    bench = Bench(drive_retries=5, retry_wait=0.1)
    bench.send(order("n0", "n1"))
    for _ in range(5):
        interrupted(bench)
        assert bench.errors == [DRIVE_RETRIED]
        later(bench, TRANSIENT_WAIT)


def test_retries_for_a_transient_cause_outlast_the_bond_of_a_dead_server() -> None:
    bench = Bench(retry_wait=0.1)
    bench.send(order("n0", "n1"))
    for _ in range(2):  # within the 4 s of the bond's time-out
        interrupted(bench)
        later(bench, TRANSIENT_WAIT)
    interrupted(bench)
    later(bench, TRANSIENT_WAIT - 0.1)
    assert (len(bench.goals), bench.errors) == (3, [DRIVE_RETRIED]), (
        "one is left when Nav2 says that it is gone"
    )


def test_a_goal_that_another_client_has_replaced_is_not_retried_as_transient() -> None:
    bench = Bench(external_goals=ExternalGoals.FAIL)
    bench.send(order("n0", "n1"))
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "RViz", transient=True))
    assert bench.errors == [ErrorType.NODE_UNREACHABLE]


def test_a_pause_delays_a_retry(bench: Bench) -> None:
    fail(bench)
    bench.instant(action("p", "NONE", "startPause"))
    later(bench, 10.0)
    assert len(bench.goals) == 1
    bench.instant(action("s", "NONE", "stopPause"))
    assert len(bench.goals) == 2


@pytest.mark.clause("6.6.5.1/keeps")
def test_an_update_resets_the_retries(bench: Bench) -> None:
    for _ in range(2):
        fail(bench)
        later(bench, 5.0)
    fail(bench)
    bench.send(order("n2", "n3", update=1, first=4))
    fail(bench)
    assert bench.errors == [DRIVE_RETRIED]


AHEAD: dict[str, Any] = {"strategy": DriveStrategy.PASS_THROUGH, "drives_ahead": True}


def ahead(bench: Bench) -> list[tuple[float, float]]:
    return [(pose.x, pose.y) for pose in bench.goal.ahead]


def test_the_first_goal_contains_the_nodes_of_the_base() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3", "n4", released=4))
    assert bench.goal.pose == Pose(10.0, 0.0, 0.0, MAP)
    assert bench.goal.ahead == (Pose(20.0, 0.0, 0.0, MAP), Pose(30.0, 0.0, 0.0, MAP))


@pytest.mark.parametrize("fields", [{"drives_ahead": False}, {"strategy": DriveStrategy.STOP_AT_NODES}])
def test_a_driver_that_cannot_pass_nodes_gets_one_node(fields: dict[str, Any]) -> None:
    bench = Bench(**(AHEAD | fields))
    bench.send(order("n0", "n1", "n2"))
    assert ahead(bench) == []


@pytest.mark.parametrize(
    "fields",
    [
        {"node_actions": {"n2": [action("a", "HARD")]}},
        {"edge_actions": {"n2-n3": [action("a", "HARD")]}},
        {"positions": {"n2": position(20.0, theta=0.0)}},
        {"positions": {"n3": position(20.0, 10.0)}},
        {"released": 3},
    ],
)
def test_a_route_ends_at_the_first_stop(fields: dict[str, Any]) -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3", **fields))
    assert ahead(bench) == [(20.0, 0.0)]


def test_a_gentle_corner_or_a_node_with_a_large_deviation_is_passed() -> None:
    bench = Bench(**AHEAD)
    places = {"n1": position(10.0), "n2": position(20.0, 3.0, radius=0.8), "n3": position(20.0, 10.0)}
    bench.send(order("n0", "n1", "n2", "n3", positions=places))
    assert ahead(bench) == [(20.0, 3.0), (20.0, 10.0)]


def test_a_long_route_is_sent_in_parts() -> None:
    bench = Bench(**AHEAD)
    bench.send(order(*(f"n{number}" for number in range(POSES_AHEAD + 10))))
    assert len(ahead(bench)) == POSES_AHEAD


def test_a_passed_node_leaves_the_remaining_poses() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", "n3"))
    bench.do(at(9.8))
    assert bench.state.last_node_id == "n1"
    assert (bench.goal.pose.x, ahead(bench)) == (20.0, [(30.0, 0.0)])


def test_a_node_is_passed_anywhere_within_its_deviation() -> None:
    bench = Bench(**AHEAD, pass_radius=0.1)
    bench.send(order("n0", "n1", "n2", positions={"n1": position(10.0, radius=0.8)}))
    bench.do(at(9.3))
    assert bench.state.last_node_id == "n1"


def test_an_extended_base_is_passed_to_the_driver_at_once() -> None:
    bench = Bench(**AHEAD)
    bench.send(order("n0", "n1", "n2", released=2))
    first = bench.goal
    assert first.ahead == ()
    bench.do(at(5.0))
    bench.send(order("n1", "n2", update=1, first=2))
    assert (bench.goal.pose, ahead(bench)) == (first.pose, [(20.0, 0.0)])
    assert bench.goal.generation > first.generation
    goals = len(bench.goals)
    bench.do(at(6.0), TimePassed())
    assert len(bench.goals) == goals


def test_a_robot_that_must_stop_at_the_next_node_gets_no_poses_beyond_it() -> None:
    policy: dict[str, Any] = {"link_loss": LinkLossPolicy.PREVENTIVE_NEXT_NODE, "link_loss_timeout": 5.0}
    bench = Bench(**AHEAD, **policy)
    bench.do(LinkReport(connected=True))
    bench.send(order("n0", "n1", "n2"))
    assert ahead(bench) == [(20.0, 0.0)]
    bench.do(LinkReport(connected=False))
    bench.now += 6.0
    bench.do(TimePassed())
    assert ahead(bench) == []


THEIRS = GoalTable((GoalReport("X", external=True, status="EXECUTING"),))
THEIRS_ENDED = GoalTable((GoalReport("X", external=True, status="SUCCEEDED", ended=True),))
OURS = GoalTable((GoalReport("A", external=False, status="EXECUTING"),))


def taken_over(policy: ExternalGoals) -> Bench:
    """Return a robot whose navigation has left its order for another program's goal."""
    bench = Bench(external_goals=policy)
    bench.send(order("n0", "n1"))
    failed = DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "X has replaced it")
    bench.do(OURS, THEIRS, failed, Halted())
    return bench


def test_pause_waits_for_the_end_of_the_other_drive_and_resends_the_goal() -> None:
    bench = taken_over(ExternalGoals.PAUSE)
    assert bench.errors == [EXTERNAL_GOAL]
    assert bench.state.driving
    assert len(bench.goals) == 1

    bench.do(THEIRS_ENDED)

    assert [goal.pose for goal in bench.goals] == [bench.goal.pose] * 2
    assert bench.errors == []
    bench.arrive()
    assert bench.nodes == []


def test_pause_continues_at_once_if_the_other_drive_has_already_ended() -> None:
    bench = Bench(external_goals=ExternalGoals.PAUSE)
    bench.send(order("n0", "n1"))
    failed = DriveFailed(bench.goal.generation, DriveFailure.TAKEN_OVER, "X has replaced it")
    bench.do(THEIRS, THEIRS_ENDED)
    assert len(bench.goals) == 1
    bench.do(failed, Halted())
    assert (len(bench.goals), bench.errors) == (2, [])


def test_fail_is_an_error_that_names_the_goal_and_an_update_retries() -> None:
    bench = taken_over(ExternalGoals.FAIL)
    (error,) = bench.state.errors
    assert error.error_type == ErrorType.NODE_UNREACHABLE
    assert "TAKEN_OVER" in str(error.error_description)

    bench.do(THEIRS_ENDED)
    assert len(bench.goals) == 1

    bench.send(order("n1", "n2", update=1, first=2))
    assert len(bench.goals) == 2


def test_pause_prevents_an_order_from_starting() -> None:
    bench = Bench(external_goals=ExternalGoals.PAUSE)
    bench.do(THEIRS)
    bench.send(order("n0", "n1"))
    assert (bench.goals, bench.errors) == ([], [EXTERNAL_GOAL])
    bench.do(GoalTable())
    assert len(bench.goals) == 1


def test_fail_fails_an_order_that_begins() -> None:
    bench = Bench(external_goals=ExternalGoals.FAIL)
    bench.do(THEIRS)
    bench.send(order("n0", "n1"))
    assert (bench.goals, bench.errors) == ([], [ErrorType.NODE_UNREACHABLE])
    assert "X" in str(bench.state.errors[0].error_description)


def test_without_an_order_an_external_goal_is_no_error() -> None:
    bench = Bench()
    bench.do(THEIRS)
    assert bench.errors == []


def test_an_order_that_waits_can_be_cancelled() -> None:
    bench = taken_over(ExternalGoals.PAUSE)
    bench.instant(action("c", "NONE", "cancelOrder"))
    assert bench.status("c") == "FINISHED"
    assert (bench.nodes, bench.errors) == ([], [])


@pytest.mark.clause("6.6.4")
def test_the_state_shows_each_goal_and_its_sender() -> None:
    bench = Bench()
    bench.do(GoalTable((*OURS.goals, *THEIRS.goals)))
    shown = bench.state.information or ()
    assert [
        (each.info_type, {r.reference_key: r.reference_value for r in each.info_references}) for each in shown
    ] == [
        ("goal", {"goalId": "A", "status": "EXECUTING"}),
        ("externalGoal", {"goalId": "X", "status": "EXECUTING"}),
    ]


def test_goals_accepted_by_navigation_are_kept_for_a_restart() -> None:
    bench = Bench()
    bench.send(order("n0", "n1"))
    before = bench.core.durable_version
    bench.do(OURS)
    assert bench.core.durable_version != before

    memory = bench.core.memory()
    own = Bench(memory=memory, ready=False).core.own_goals

    assert own is not None
    assert (own.goal_ids, own.pose) == (("A",), bench.goal.pose)
    bench.do(GoalTable())
    assert bench.core.memory().own_goals == memory.own_goals, "what it has come to is not told yet"
    bench.arrive()
    assert bench.core.memory().own_goals is None


def test_a_goal_not_listed_yet_does_not_lend_its_pose_to_the_previous_one() -> None:
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    bench.do(OURS)
    first = bench.goal.pose
    bench.arrive()
    bench.do(GoalTable(OURS.goals))
    own = bench.core.own_goals
    assert own is not None
    assert own.pose == first
    assert bench.goal.pose != first


DISCONNECTED, CONNECTED = LinkReport(connected=False), LinkReport(connected=True)


def under_way(policy: LinkLossPolicy, **capabilities: Any) -> Bench:
    """Return a robot on its way to the first of two nodes."""
    bench = Bench(link_loss=policy, link_loss_timeout=10.0, **capabilities)
    bench.do(CONNECTED)
    bench.send(order("n0", "n1", "n2"))
    return bench


def lose(bench: Bench, seconds: float) -> None:
    bench.do(DISCONNECTED)
    bench.now += seconds
    bench.do(TimePassed())


def test_an_assertive_robot_drives_its_base_to_the_end() -> None:
    bench = under_way(LinkLossPolicy.ASSERTIVE)
    lose(bench, 3600.0)
    bench.arrive()
    bench.arrive()
    assert bench.nodes == []
    assert not bench.effects_of(Halt)
    assert not bench.waits()


def test_a_preventive_robot_stops_after_its_timeout_and_continues_when_the_broker_returns() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE)
    lose(bench, 9.9)
    assert bench.waits()
    assert not bench.effects_of(Halt)
    bench.now += 0.2
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 1
    bench.halted()
    assert not bench.state.driving

    bench.do(CONNECTED)

    assert [goal.pose for goal in bench.goals] == [bench.goal.pose] * 2
    assert bench.nodes == ["n1", "n2"]


def test_a_short_link_loss_is_ignored() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE)
    lose(bench, 9.0)
    bench.do(CONNECTED)
    bench.now += 60.0
    bench.do(TimePassed())
    assert not bench.effects_of(Halt)


def test_a_preventive_robot_waits_at_the_next_node() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_NEXT_NODE)
    lose(bench, 20.0)
    assert not bench.effects_of(Halt)
    bench.arrive()
    assert (bench.nodes, len(bench.goals)) == (["n2"], 1)
    bench.do(CONNECTED)
    assert len(bench.goals) == 2


def test_a_preventive_robot_does_not_pass_the_next_node() -> None:
    bench = under_way(LinkLossPolicy.PREVENTIVE_NEXT_NODE, strategy=DriveStrategy.PASS_THROUGH)
    lose(bench, 20.0)
    bench.do(at(9.9))
    assert (bench.nodes, len(bench.goals)) == (["n1", "n2"], 1)


def test_a_robot_that_was_never_connected_waits_too() -> None:
    memory = under_way(LinkLossPolicy.PREVENTIVE_AT_ONCE).core.memory()
    bench = Bench(memory=memory, link_loss=LinkLossPolicy.PREVENTIVE_AT_ONCE, link_loss_timeout=10.0)
    assert len(bench.goals) == 1
    bench.now += 11.0
    bench.do(TimePassed())
    assert len(bench.effects_of(Halt)) == 1


def test_the_timeout_begins_at_the_start() -> None:
    bench = Bench(ready=False, link_loss=LinkLossPolicy.PREVENTIVE_AT_ONCE)
    assert not bench.waits()
    bench.do(Started())
    assert bench.waits()
