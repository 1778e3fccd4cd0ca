"""Localisers other than AMCL, which latches its pose."""

from __future__ import annotations

from itertools import count
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy

from nena_edge_agent.driver.port import PoseReport
from support.nav2_driver import DrivenRobot
from support.ros import LATCHED, RosPeer
from support.waiting import until

pytestmark = pytest.mark.ros

QOS = {
    "latched": LATCHED,
    "reliable": QoSProfile(depth=1),
    "best effort": QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
}


def pose(x: int) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.header.stamp.sec = x
    message.pose.pose.position.x = float(x)
    message.pose.pose.orientation.w = 1.0
    return message


@pytest.mark.parametrize("qos", QOS.values(), ids=QOS)
async def test_pose_is_received_with_any_quality_of_service(peer: RosPeer, domain_id: int, qos: Any) -> None:
    places = count(1)
    async with DrivenRobot(domain_id) as robot:
        publisher = peer.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", qos)

        def heard() -> bool:
            publisher.publish(pose(next(places)))
            return bool(robot.all(PoseReport))

        await until(heard, what="a pose")


async def test_latched_pose_is_received_late_and_each_pose_once(peer: RosPeer, domain_id: int) -> None:
    publisher = peer.node.create_publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
    publisher.publish(pose(3))
    async with DrivenRobot(domain_id) as robot:
        await robot.hears(PoseReport)
        publisher.publish(pose(7))
        await robot.hears(PoseReport, lambda report: report.pose.x == 7.0)

    assert [report.pose.x for report in robot.all(PoseReport)] == [3.0, 7.0]
