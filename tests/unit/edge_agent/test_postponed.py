from __future__ import annotations

from nena_edge_agent.driver.port import DriveGoal, Pose
from nena_edge_agent.postponed import Postponed
from nena_edge_agent.protocol.effects import (
    CancelAction,
    Drive,
    Effect,
    Halt,
    PauseAction,
    ReportState,
    StartAction,
)
from support.robot_core import action

DRIVE = Drive(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.5))
OTHER = Drive(DriveGoal(2, Pose(2.0, 0.0, 0.0, "hall"), 0.5))
LOAD, LIFT = (StartAction(action(name), ()) for name in ("load", "lift"))


def test_what_is_recorded_is_done_at_once_in_its_order() -> None:
    effects: list[Effect] = [Halt(), DRIVE, LOAD, ReportState()]
    assert Postponed().sift(effects, recorded=True) == effects


def test_what_is_not_recorded_is_not_begun_until_it_is() -> None:
    postponed = Postponed()
    assert postponed.sift([DRIVE, LOAD, ReportState()], recorded=False) == [ReportState()]
    assert postponed.sift([LIFT], recorded=False) == []
    assert postponed.sift([OTHER], recorded=True) == [DRIVE, LOAD, LIFT, OTHER]
    assert postponed.sift([], recorded=True) == []


def test_what_ends_is_never_postponed_and_what_it_ends_is_not_begun() -> None:
    postponed = Postponed()
    postponed.sift([DRIVE, LOAD, LIFT], recorded=False)
    ends: list[Effect] = [Halt(), CancelAction("load"), PauseAction("lift")]
    assert postponed.sift(ends, recorded=False) == ends
    assert postponed.sift([], recorded=True) == [LIFT]
