"""An edge names the behaviour tree of its goal, and the robot stops where the tree changes."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.actions.builtin import UseBehaviorTree
from nena_edge_agent.driver.port import Pose, PoseReport
from nena_edge_agent.protocol.capabilities import DriveStrategy
from nena_edge_agent.protocol.declaration import PREDEFINED
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.own_actions import USE_BEHAVIOR_TREE
from support.robot_core import MAP, Bench, action, order

TREES = UseBehaviorTree(("careful", "fast")).declaration


def tree(name: str, action_id: str = "t") -> Action:
    return action(action_id, "NONE", USE_BEHAVIOR_TREE, behaviorTree=name)


def robot(**capabilities: Any) -> Bench:
    actions = {**PREDEFINED, TREES.action_type: TREES}
    chosen: dict[str, Any] = {"actions": actions, "strategy": DriveStrategy.PASS_THROUGH}
    return Bench(**(chosen | capabilities))


def test_the_goal_of_an_edge_has_its_tree_and_the_next_one_has_none() -> None:
    bench = robot()
    bench.send(order("n0", "n1", "n2", edge_actions={"n0-n1": [tree("careful")]}))
    assert bench.goal.behavior_tree == "careful"
    bench.arrive()
    assert bench.goal.behavior_tree == ""


@pytest.mark.parametrize(("second", "passes"), [("careful", True), ("fast", False)])
def test_a_node_is_passed_only_if_the_next_edge_has_the_same_tree(second: str, *, passes: bool) -> None:
    bench = robot()
    edges = {"n0-n1": [tree("careful")], "n1-n2": [tree(second, "u")]}
    bench.send(order("n0", "n1", "n2", edge_actions=edges))
    bench.do(PoseReport(Pose(9.9, 0.0, 0.0, MAP), localized=True))
    assert (bench.goal.pose.x == 20.0) is passes


@pytest.mark.parametrize(("second", "ahead"), [("careful", 1), ("fast", 0)])
def test_a_route_through_several_nodes_has_one_behaviour_tree(second: str, ahead: int) -> None:
    bench = robot(drives_ahead=True)
    edges = {"n0-n1": [tree("careful")], "n1-n2": [tree(second, "u")]}
    bench.send(order("n0", "n1", "n2", edge_actions=edges))
    assert len(bench.goal.ahead) == ahead


def test_a_behaviour_tree_that_is_not_configured_is_refused() -> None:
    bench = robot()
    bench.send(order("n0", "n1", edge_actions={"n0-n1": [tree("reckless")]}))
    assert bench.errors == ["INVALID_ORDER_ACTION"]
    assert not bench.goals
