"""Edges with a trajectory or a corridor, for a robot that follows paths of its own."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import GoalReport, GoalTable, Halted, NavigationReport, OwnGoals, Pose
from nena_edge_agent.nav2.commands import Report
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix
from nena_edge_agent.nav2.settings import GoalSettings
from nena_edge_agent.nav2.trackers import Trackers
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.events import Halt, Started
from nena_shared.ros import GoalStatus
from nena_shared.vda5050.order import ControlPoint, Corridor, Order, Trajectory
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, action, at, order, position

TURN = Trajectory(
    degree=2,
    knot_vector=(0, 0, 0, 1, 1, 1),
    control_points=(ControlPoint(x=0, y=0), ControlPoint(x=10, y=0), ControlPoint(x=10, y=10)),
)
ON = Trajectory(degree=1, control_points=(ControlPoint(x=10, y=10), ControlPoint(x=10, y=20)))
PLACES = {"n1": position(10, 10, radius=0.5), "n2": position(10, 20)}
WIDE = Corridor(left_width=1.0, right_width=0.4)


def robot(**capabilities: Any) -> Bench:
    return Bench(**({"follows_paths": True} | capabilities))


def edges(*fields: dict[str, Any], **more: Any) -> Order:
    """Make an order whose edges have these fields, from n0 on."""
    names = [f"n{index}" for index in range(len(fields) + 1)]
    made = order(*names, **({"positions": PLACES} | more))
    changed = tuple(edge.model_copy(update=each) for edge, each in zip(made.edges, fields, strict=True))
    return made.model_copy(update={"edges": changed})


def test_an_edge_with_a_trajectory_is_driven_along_it() -> None:
    bench = robot()
    bench.send(edges({"trajectory": TURN}))
    path = bench.goal.path
    assert (path[0].x, path[0].y) == (0.0, 0.0)
    assert (path[-1].x, path[-1].y) == (10.0, 10.0)
    assert any((each.x, each.y) == pytest.approx((7.5, 2.5), abs=0.1) for each in path)
    assert bench.goal.pose.theta == path[-1].theta == pytest.approx(1.57, abs=0.05)


def test_navigation_plans_edges_without_a_trajectory() -> None:
    bench = robot()
    bench.send(edges({}))
    assert bench.goal.path == ()


@pytest.mark.parametrize("version", ["2.1.0", "3.0.0"])
def test_invalid_knots_are_refused_and_the_edge_is_named(version: str) -> None:
    bench = robot(rules=RULES[version])
    bench.send(edges({"trajectory": TURN.model_copy(update={"knot_vector": (0, 1)})}))
    (entry,) = bench.state.errors
    assert entry.error_type == "VALIDATION_FAILURE"
    assert {each.reference_key: each.reference_value for each in entry.error_references}["edgeId"] == "n0-n1"
    assert not bench.goals


def test_after_a_pause_only_the_rest_of_the_path_is_driven() -> None:
    bench = robot()
    bench.send(edges({"trajectory": TURN}))
    bench.do(at(7.5, 2.5, 0.8))
    bench.instant(action("p", "NONE", "startPause"))
    bench.do(Halted())
    bench.instant(action("r", "NONE", "stopPause"))
    first = bench.goal.path[0]
    assert (first.x, first.y) == pytest.approx((7.5, 2.5), abs=0.15)


@pytest.mark.parametrize(("second", "passes"), [({"trajectory": ON}, True), ({}, False)])
def test_a_node_is_passed_only_from_path_to_path(second: dict[str, Any], *, passes: bool) -> None:
    bench = robot(strategy=DriveStrategy.PASS_THROUGH)
    bench.send(edges({"trajectory": TURN}, second))
    bench.do(at(9.99, 9.6, 1.57))
    assert (bench.state.last_node_id == "n1") is passes
    if passes:
        first = bench.goal.path[0]
        assert first.y < 9.75, "the rest of the first path comes before the second"
        assert bench.goal.path[-1].y == 20.0


def test_a_path_has_no_poses_ahead() -> None:
    bench = robot(strategy=DriveStrategy.PASS_THROUGH, drives_ahead=True)
    bench.send(edges({"trajectory": TURN}, {}))
    assert bench.goal.ahead == ()


def test_poses_ahead_end_before_a_path() -> None:
    bench = robot(strategy=DriveStrategy.PASS_THROUGH, drives_ahead=True)
    bench.send(edges({}, {"trajectory": ON}))
    assert (bench.goal.path, bench.goal.ahead) == ((), ())


@pytest.mark.clause("6.1.5", "6.6.5.4")
@pytest.mark.parametrize("corridor", [WIDE, None])
def test_a_robot_outside_of_its_corridor_stops_until_it_is_back(corridor: Corridor | None) -> None:
    bench = robot()
    bench.send(edges({"trajectory": TURN, "corridor": corridor}))
    bench.do(at(7.5, 2.5, 0.8))
    assert bench.errors == []
    effects = bench.do(at(8.5, 1.5, 0.8))
    assert any(isinstance(each, Halt) for each in effects)
    assert bench.errors == ["OUTSIDE_OF_CORRIDOR"]
    bench.do(Halted())
    given = len(bench.goals)
    bench.do(at(8.4, 1.6, 0.8))
    assert len(bench.goals) == given
    bench.do(at(7.5, 2.5, 0.8))
    assert (bench.errors, len(bench.goals)) == ([], given + 1)


def test_an_edge_of_the_horizon_has_no_corridor_to_leave() -> None:
    bench = robot()
    bench.send(edges({}, {"trajectory": ON, "corridor": WIDE}, released=2))
    bench.do(at(10.0, 10.0, 0.8))
    bench.arrive()
    assert bench.state.last_node_id == "n1"
    bench.do(at(15.0, 12.0, 0.8))
    assert bench.errors == []


def test_a_trajectory_that_returns_to_its_start_is_refused() -> None:
    """Nav2's controller would count it as driven at once, and a retry drive it twice."""
    ring = Trajectory(
        degree=1,
        control_points=tuple(ControlPoint(x=x, y=y) for x, y in ((0, 0), (4, 0), (4, 4), (0, 4), (0, 0.05))),
    )
    bench = robot()
    bench.send(edges({"trajectory": ring}, positions={"n1": position(0, 0)}))
    assert (bench.errors, bench.goals) == (["UNSUPPORTED_PARAMETER"], [])
    assert "divide the edge" in str(bench.state.errors)


def test_a_short_straight_trajectory_is_driven() -> None:
    short = Trajectory(degree=1, control_points=(ControlPoint(x=0, y=0), ControlPoint(x=0.3, y=0)))
    bench = robot()
    bench.send(edges({"trajectory": short}, positions={"n1": position(0.3, 0)}))
    assert bench.goal.path


def test_a_corridor_that_requires_a_release_is_not_used() -> None:
    bench = robot()
    asks = Corridor(left_width=5.0, right_width=5.0, release_required=True)
    bench.send(edges({"trajectory": TURN, "corridor": asks}))
    bench.do(at(8.5, 1.5, 0.8))
    assert bench.errors == ["OUTSIDE_OF_CORRIDOR"]


@pytest.mark.clause("6.6.2")
def test_the_state_shows_the_path_and_its_trajectory() -> None:
    bench = robot(rules=RULES["3.0.0"])
    bench.send(edges({"trajectory": TURN}, {}))
    state = bench.state
    assert state.edge_states[0].trajectory == TURN
    assert state.planned_path is not None
    places = [(each.x, each.y) for each in state.planned_path.trajectory.control_points]
    assert (places[0], places[-1]) == ((0.0, 0.0), (10.0, 20.0))
    assert any(7 < x < 8 and 2 < y < 3 for x, y in places)


def test_after_a_restart_on_a_path_an_operators_goal_is_not_adopted() -> None:
    bench = robot()
    bench.send(edges({"trajectory": TURN}))
    kept = Bench(memory=bench.core.memory(), ready=False, follows_paths=True).core.own_goals
    assert kept is not None
    trackers, place = Trackers(GoalSettings(), GoalIdPrefix("agent")), Pose(10.0, 10.0, 1.5, "hall")
    trackers.reclaim(OwnGoals(kept.goal_ids, place, place if kept.given else None, kept.behind))
    operators = [GoalEntry("ff" * 16, GoalStatus.EXECUTING)]
    (said,) = trackers.navigator.on_statuses(operators, 0.0)
    assert said == Report(GoalTable((GoalReport("ff" * 16, external=True, status="EXECUTING"),)))
    assert trackers.tick(1.0) == trackers.tick(60.0) == []


def test_after_a_restart_the_robot_continues_on_its_path() -> None:
    bench = robot()
    bench.send(edges({"trajectory": TURN}))
    bench.do(at(7.5, 2.5, 0.8))
    again = Bench(memory=bench.core.memory(), ready=False, follows_paths=True)
    again.do(Started(), at(7.5, 2.5, 0.8), NavigationReport(available=True, reason=""))
    assert again.goal.path[0].x == pytest.approx(7.5, abs=0.15)
