from __future__ import annotations

import math
from typing import Any
from uuid import UUID

import pytest
from geometry_msgs.msg import PoseStamped

from nena_robot_simulator import messages
from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action, GoalEntry
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.robot import Feedback
from nena_shared.ros import GoalStatus
from support.action_types import needs_action_types

pytestmark = [pytest.mark.ros, needs_action_types]

GOAL_ID = UUID(int=7)


def request(action: Action) -> Any:
    message = action_types()[action].Impl.SendGoalService.Request()
    message.goal_id.uuid = list(GOAL_ID.bytes)
    return message


def place(x: float) -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = "map"
    message.pose.position.x = x
    return message


def test_reads_a_goal() -> None:
    message = request(Action.TO_POSE)
    message.goal.pose = place(3.0)
    goal = messages.goal_of(message, Action.TO_POSE)
    assert (goal.goal_id, goal.pose, goal.frame_id, goal.via) == (GOAL_ID, Pose(3.0, 0.0, 0.0), "map", ())


def test_reads_a_goal_over_several_places() -> None:
    message = request(Action.THROUGH_POSES)
    message.goal.poses = [place(1.0), place(2.0)]
    goal = messages.goal_of(message, Action.THROUGH_POSES)
    assert (goal.via, goal.pose) == ((Pose(1.0, 0.0, 0.0),), Pose(2.0, 0.0, 0.0))


def test_a_goal_without_a_place_leads_nowhere() -> None:
    goal = messages.goal_of(request(Action.THROUGH_POSES), Action.THROUGH_POSES)
    assert math.isnan(goal.pose.x)


@pytest.mark.parametrize(
    ("entry", "expected"), [(GoalEntry(GOAL_ID, 0, GoalStatus.ABORTED, 105), (6, 105)), (None, (0, 0))]
)
def test_fills_a_result(entry: GoalEntry | None, expected: tuple[int, int]) -> None:
    response = action_types()[Action.TO_POSE].Impl.GetResultService.Response()
    messages.fill_result(response, entry)
    assert (response.status, response.result.error_code) == expected


@pytest.mark.parametrize(("speed", "left", "seconds"), [(2.0, 5.0, 2.5), (0.0, 5.0, 0.0), (2.0, 0.05, 0.0)])
def test_tells_how_a_drive_stands(speed: float, left: float, seconds: float) -> None:
    feedback = Feedback(GOAL_ID, Pose(1, 2, 0), 1.5, left, speed, recoveries=3, places_left=2)
    types = action_types()[Action.THROUGH_POSES]
    message = messages.feedback_message(types, feedback, "map", 10**9)
    told = message.feedback
    assert bytes(message.goal_id.uuid) == GOAL_ID.bytes
    assert (told.current_pose.pose.position.x, told.number_of_recoveries) == (1.0, 3)
    assert (told.number_of_poses_remaining, told.navigation_time.nanosec) == (2, 500_000_000)
    assert told.distance_remaining == pytest.approx(left)
    remaining = told.estimated_time_remaining
    assert remaining.sec + remaining.nanosec / 1e9 == pytest.approx(seconds)
