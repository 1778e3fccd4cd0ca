from __future__ import annotations

from collections.abc import Iterable

import pytest

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.ros import action_door
from nena_edge_agent.ros.action_side import ActionSide
from nena_edge_agent.ros.action_tracker import ActionTracker
from nena_edge_agent.ros.commands import Command
from nena_edge_agent.ros.goal_mark import GoalMark
from nena_edge_agent.ros.settings import GoalSettings, Navigation, RosSettings
from nena_shared.clock import SystemClock
from nena_shared.program import StartError
from support.action_types import needs_action_types

pytestmark = pytest.mark.ros

TRACKER = ActionTracker(GoalSettings(), GoalMark("agent"))


def side(applied: list[Command] | None = None) -> ActionSide:
    def apply(commands: Iterable[Command]) -> None:
        (applied if applied is not None else []).extend(commands)

    return ActionSide(TRACKER, apply=apply, on_feedback=lambda _reading: None, clock=SystemClock())


def test_without_its_types_the_action_cannot_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_door, "action_type", lambda _navigation: None)
    with pytest.raises(StartError, match=r"ros\.navigation = topics"):
        side().check(RosSettings(navigation=Navigation.ACTION))
    side().check(RosSettings(navigation=Navigation.AUTO))


def test_without_its_types_there_is_no_door(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_door, "action_type", lambda _navigation: None)
    alone = side()
    assert alone.new_door(RosSettings()) == []
    assert not alone.look()


@needs_action_types
@pytest.mark.parametrize(("navigation", "doors"), [("auto", 1), ("action", 1), ("topics", 0)])
def test_a_node_gets_a_door_where_one_is_wanted(navigation: str, doors: int) -> None:
    assert len(side().new_door(RosSettings(navigation=Navigation(navigation)))) == doors


async def test_a_goal_that_no_door_takes_has_no_answer() -> None:
    applied: list[Command] = []
    goal = MapGoal(1, MapPose(1.0, 0.0, 0.0, "hall"), deviation_xy=0.5)
    await side(applied).send(goal, GoalMark("agent").new())
    side().ask_result("aa")
    assert applied == []
