"""What a whole Nav2 (Jazzy 1.3.13) was measured to do, as another node sees it of the simulated robot."""

from __future__ import annotations

import json
from typing import Any

import pytest
from nav_msgs.msg import OccupancyGrid, Odometry
from std_msgs.msg import String

from support.action_client import ABORTED, SUCCEEDED, Client, outcome_of
from support.action_types import needs_nav2_types
from support.ros import BEST_EFFORT, LATCHED, RELIABLE, RosPeer
from support.simulator import heard, publisher_to, simulated_robot
from support.waiting import wait_until

pytestmark = [pytest.mark.ros, needs_nav2_types]


def fault(peer: RosPeer, kind: str, **fields: Any) -> None:
    publisher_to(peer, String, "simulator/fault").publish(String(data=json.dumps({"kind": kind, **fields})))
    heard(peer)


def publish_mask(peer: RosPeer) -> None:
    """Publish a keep-out mask from (3, -1) to (7, 1)."""
    from nav2_msgs.msg import CostmapFilterInfo  # noqa: PLC0415 - not everywhere

    mask = OccupancyGrid(data=[100] * 8)
    mask.info.width, mask.info.height, mask.info.resolution = 4, 2, 1.0
    mask.info.origin.position.x, mask.info.origin.position.y = 3.0, -1.0
    info = CostmapFilterInfo(filter_mask_topic="/zone_filter_mask", multiplier=1.0)
    peer.node.create_publisher(OccupancyGrid, "/zone_filter_mask", LATCHED).publish(mask)
    peer.node.create_publisher(CostmapFilterInfo, "/zone_filter_info", LATCHED).publish(info)


@pytest.mark.parametrize("topic", [None, "/zone_filter_info"])
def test_a_keep_out_mask_by_an_absolute_topic_is_obeyed(
    domain_id: int, peer: RosPeer, topic: str | None
) -> None:
    with simulated_robot(domain_id, filter_info_topic=topic):
        client = Client(peer)
        publish_mask(peer)
        refused = (ABORTED, 208)
        wait_until(lambda: outcome_of(client.send((5.0, 0.0))) == refused, what="the mask in the costmap")
        assert outcome_of(client.send((9.0, 0.0))) == (SUCCEEDED, 0)


@pytest.mark.parametrize(
    ("topic", "namespace", "used"),
    [
        ("zone_filter_info", "", "/global_costmap/zone_filter_info"),
        ("zone_filter_info", "r1", "/r1/global_costmap/zone_filter_info"),
        ("/zone_filter_info", "r1", "/zone_filter_info"),
        (None, "r1", "/r1/zone_filter_info"),
    ],
)
def test_a_relative_topic_of_a_filter_is_in_the_namespace_of_the_costmap(
    domain_id: int, peer: RosPeer, topic: str | None, namespace: str, used: str
) -> None:
    with simulated_robot(domain_id, namespace, filter_info_topic=topic):
        wait_until(lambda: peer.node.count_subscribers(used) == 1, what=f"a subscription to {used}")


def test_without_its_mask_a_costmap_lets_the_robot_drive_into_the_zone(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, filter_info_topic="zone_filter_info"):
        client = Client(peer)
        publish_mask(peer)
        heard(peer)
        assert outcome_of(client.send((5.0, 0.0))) == (SUCCEEDED, 0)
        assert peer.node.count_subscribers("/zone_filter_mask") == 0


def test_the_collision_monitor_speaks_only_while_the_base_is_commanded(domain_id: int, peer: RosPeer) -> None:
    from nav2_msgs.msg import CollisionMonitorState  # noqa: PLC0415 - not everywhere

    with simulated_robot(domain_id):
        client = Client(peer)
        odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
        states = peer.subscribe(CollisionMonitorState, "collision_monitor_state", RELIABLE)
        fault(peer, "collision_stop")
        assert states.stays_silent(0.5), "the robot has no goal"
        handle = client.send((5.0, 0.0))
        assert states.wait_for().action_type == 1
        late = peer.subscribe(CollisionMonitorState, "collision_monitor_state", LATCHED)
        assert late.stays_silent(0.5), "volatile: a late subscriber does not know"
        handle.cancel_goal_async()
        outcome_of(handle)
        fault(peer, "collision_stop", active=False)
        assert states.stays_silent(0.5), "its last word is still the stop"
        assert odometry.messages[-1].twist.twist.linear.x == 0.0
        client.send((5.0, 0.0))
        wait_until(lambda: [each.action_type for each in states.messages] == [1, 0], what="the end")
