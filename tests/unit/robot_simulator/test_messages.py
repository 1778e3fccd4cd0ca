from __future__ import annotations

import math
from uuid import UUID

import pytest
from geometry_msgs.msg import Pose as PoseMessage

from nena_robot_simulator import messages
from nena_robot_simulator.goals import GoalEntry
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.sensors import Battery
from nena_shared.ros import GoalStatus

pytestmark = pytest.mark.ros


@pytest.mark.parametrize("yaw", [-3.1, -1.0, 0.0, 0.5, 3.14])
def test_a_pose_comes_back_as_it_was(yaw: float) -> None:
    assert messages.pose_of(messages.pose_message(Pose(1.5, -2.5, yaw))) == pytest.approx((1.5, -2.5, yaw))


def test_whole_numbers_become_floating_point_ones() -> None:
    message = messages.pose_message(Pose(3, 4, 0))
    assert (type(message.position.x), type(message.position.y)) == (float, float)
    assert type(messages.battery_message(make_battery(1), "percent", 0).percentage) is float


def make_battery(charge: float) -> Battery:
    return Battery(charge=charge, per_metre=0.0, per_second=0.0)


def test_a_broken_orientation_is_dropped_for_a_pose_and_overlooked_for_a_goal() -> None:
    broken = PoseMessage()
    broken.position.x = 2.0
    broken.orientation.w = 0.0
    assert messages.pose_of(broken) is None
    assert messages.goal_pose_of(broken) == Pose(2.0, 0.0, 0.0)


def test_a_place_that_is_no_number_is_dropped_for_a_pose_and_kept_for_a_goal() -> None:
    broken = messages.pose_message(Pose(math.nan, 0.0, 1.0))
    assert messages.pose_of(broken) is None
    assert math.isnan(messages.goal_pose_of(broken).x)


def test_stamps_keep_their_nanoseconds() -> None:
    stamp = messages.stamp_of(1_700_000_000_123_456_789)
    assert (stamp.sec, stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert messages.nanoseconds_of(stamp) == 1_700_000_000_123_456_789


def test_a_status_array_holds_ids_stamps_and_codes_in_order() -> None:
    first, second = UUID(int=2**127 + 5), UUID(int=1)
    array = messages.status_array(
        [GoalEntry(first, 7, GoalStatus.ABORTED), GoalEntry(second, 8, GoalStatus.EXECUTING)]
    )
    assert [messages.goal_id_of(entry.goal_info) for entry in array.status_list] == [first, second]
    assert [messages.nanoseconds_of(entry.goal_info.stamp) for entry in array.status_list] == [7, 8]
    assert [entry.status for entry in array.status_list] == [6, 2]
