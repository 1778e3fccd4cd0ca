"""What goes out, as another node reads it."""

from __future__ import annotations

import math
from uuid import uuid4

import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.nav2 import messages
from nena_edge_agent.nav2.messages import UnusablePoseError, plan_points, pose_reading
from nena_edge_agent.nav2.poses import PLAN_POINTS
from support.ros import RosPeer

pytestmark = pytest.mark.ros


def test_integers_are_converted_to_floats(peer: RosPeer) -> None:
    inbox = peer.subscribe(PoseStamped, "goal_pose")
    peer.publisher(PoseStamped, "goal_pose").publish(messages.goal_message(Pose(3, -2, 0, "hall"), "map"))
    arrived = inbox.wait_for()
    assert (arrived.pose.position.x, arrived.pose.position.y, arrived.pose.orientation.w) == (3.0, -2.0, 1.0)
    assert arrived.header.frame_id == "map"


@pytest.mark.parametrize("theta", [0.5, -3.0, 7.0])
def test_initial_pose_comes_back_as_it_was_read(peer: RosPeer, theta: float) -> None:
    inbox = peer.subscribe(PoseWithCovarianceStamped, "initialpose")
    message = messages.initial_pose_message(
        Pose(1.5, 2.5, theta, "hall"), "map", xy_variance=0.25, theta_variance=0.068
    )
    peer.publisher(PoseWithCovarianceStamped, "initialpose").publish(message)
    reading = pose_reading(inbox.wait_for())
    assert (reading.x, reading.y, reading.frame) == (1.5, 2.5, "map")
    assert math.cos(reading.yaw - theta) == pytest.approx(1.0)
    assert (reading.x_variance, reading.y_variance, reading.yaw_variance) == (0.25, 0.25, 0.068)


@pytest.mark.parametrize("pose", [(math.nan, 0, 0), (0, math.inf, 0), (0, 0, math.nan)])
def test_non_finite_number_is_not_sent(pose: tuple[float, float, float]) -> None:
    with pytest.raises(messages.NotFiniteError):
        messages.goal_message(Pose(*pose, "hall"), "map")


def test_cancel_request_names_one_goal_and_no_time() -> None:
    goal_id = uuid4()
    request = messages.cancel_request(goal_id.hex)
    assert bytes(request.goal_info.goal_id.uuid) == goal_id.bytes
    assert (request.goal_info.stamp.sec, request.goal_info.stamp.nanosec) == (0, 0)


def test_pose_without_a_heading_is_refused() -> None:
    message = PoseWithCovarianceStamped()
    message.pose.pose.orientation.w = 0.0
    with pytest.raises(UnusablePoseError):
        pose_reading(message)


def path(*places: tuple[float, float]) -> Path:
    message = Path()
    message.header.frame_id = "map"
    for x, y in places:
        pose = PoseStamped()
        pose.pose.position.x, pose.pose.position.y = x, y
        message.poses.append(pose)
    return message


def test_plan_is_thinned_out_and_keeps_its_end() -> None:
    frame, points = plan_points(path(*((0.1 * number, 1.0) for number in range(1000))))
    assert frame == "map"
    assert len(points) <= PLAN_POINTS + 1
    assert points[0] == (0.0, 1.0)
    assert points[-1] == pytest.approx((99.9, 1.0))
    assert plan_points(path((1.0, 2.0), (3.0, 4.0)))[1] == ((1.0, 2.0), (3.0, 4.0))
    assert plan_points(path())[1] == ()


def test_plan_with_an_invalid_point_is_refused() -> None:
    with pytest.raises(UnusablePoseError):
        plan_points(path((0.0, 0.0), (math.nan, 0.0)))
