from __future__ import annotations

import pytest

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.ros.drive import LATE_AT_MOST, Drive

WAIT = 2.0


def pose(x: float) -> MapPose:
    return MapPose(x, 0.0, 0.0, "hall")


@pytest.fixture
def drive() -> Drive:
    """Give one whose goal was reported reached at 100 s."""
    return Drive(MapGoal(1, pose(5.0), deviation_xy=0.25), reached_at=100.0)


def test_a_pose_is_waited_for_from_the_arrival_on(drive: Drive) -> None:
    assert drive.pose_may_come(101.9, WAIT)
    assert not drive.pose_may_come(102.0, WAIT)
    assert not Drive(drive.goal).pose_may_come(0.0, WAIT)


def test_a_pose_of_a_robot_under_way_is_a_late_one(drive: Drive) -> None:
    drive.on_pose(pose(3.0), pose(2.0), 101.0)
    assert drive.pose_may_come(102.9, WAIT)
    drive.on_pose(pose(3.05), pose(3.0), 102.0)
    assert not drive.pose_may_come(103.0, WAIT), "it stands"


def test_poses_are_late_for_a_while_only(drive: Drive) -> None:
    drive.on_pose(pose(3.0), pose(2.0), 150.0)
    assert drive.late_at == 100.0 + LATE_AT_MOST


def test_before_the_arrival_no_pose_is_late() -> None:
    drive = Drive(MapGoal(1, pose(5.0), deviation_xy=0.25))
    drive.on_pose(pose(3.0), pose(2.0), 1.0)
    drive.reached_at = 2.0
    assert not drive.pose_may_come(4.0, WAIT)
