"""What a whole Nav2 (Jazzy 1.3.13) was measured to do, as another node sees it of the simulated robot."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_system_default
from std_msgs.msg import String

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from support.action_client import ABORTED, CANCELED, SUCCEEDED, Client, answer_of, outcome_of
from support.action_types import needs_nav2_types
from support.ros import BEST_EFFORT, LATCHED, RELIABLE, RosPeer
from support.simulator import goal, heard, publisher_to, simulated_robot, trace
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
        assert states.stays_silent(0.5)
        assert not states.messages, "the robot has no goal"
        handle = client.send((5.0, 0.0))
        assert states.wait_for().action_type == 1
        late = peer.subscribe(CollisionMonitorState, "collision_monitor_state", LATCHED)
        assert late.stays_silent(0.5), "volatile: a late subscriber does not know"
        handle.cancel_goal_async()
        outcome_of(handle)
        fault(peer, "collision_stop", active=False)
        assert states.stays_silent(0.5)
        assert len(states.messages) == 1, "its last word is still the stop"
        assert odometry.messages[-1].twist.twist.linear.x == 0.0
        client.send((5.0, 0.0))
        wait_until(lambda: [each.action_type for each in states.messages] == [1, 0], what="the end")


def test_a_killed_navigator_accepts_goals_in_silence(domain_id: int, peer: RosPeer) -> None:
    """Until its DDS lease ends its server looks ready, and after its restart nothing is answered either."""
    with simulated_robot(domain_id):
        client = Client(peer)
        running = client.send((9.0, 0.0)).get_result_async()
        fault(peer, "server_died", server="bt_navigator", lease=3.0)
        assert client.ros.server_is_ready()
        request = action_types()[Action.TO_POSE].Goal(pose=goal(1.0, 0.0))
        sent = client.ros.send_goal_async(request)
        wait_until(lambda: not client.ros.server_is_ready(), what="the end of its lease")
        fault(peer, "server_died", server="bt_navigator", active=False)
        wait_until(client.ros.server_is_ready, what="the next server")
        assert not sent.done()
        assert not running.done()


def test_nav2_that_is_stopped_in_order_ends_its_goals_without_a_code(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        client = Client(peer)
        handle = client.send((20.0, 0.0))
        result = handle.get_result_async()
        publisher = publisher_to(peer, String, "simulator/fault")
        heard(peer)  # with the request for the result
        publisher.publish(String(data='{"kind": "nav2_stopped"}'))
        answer = answer_of(result)
        assert (answer.status, answer.result.error_code) == (ABORTED, 0)
        wait_until(lambda: not client.ros.server_is_ready(), what="the end of the processes")


def test_a_cancelled_goal_may_have_a_code(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, recovery_time=60.0):
        fault(peer, "unreachable")
        client = Client(peer)
        handle = client.send((5.0, 0.0))
        client.feedback.wait_for(lambda told: told.number_of_recoveries > 0)
        answer_of(handle.cancel_goal_async())
        assert outcome_of(handle) == (CANCELED, 208)


def test_a_result_is_forgotten_while_the_array_still_lists_its_goal(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, result_timeout=0.3):
        client = Client(peer)
        handle = client.send((1.0, 0.0))
        arrays = peer.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
        arrays.wait_for(lambda array: array.status_list[-1].status == SUCCEEDED)
        assert arrays.stays_silent(0.5)
        assert outcome_of(handle) == (0, 0)
        late = peer.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
        late.wait_for()
        assert trace(late.messages) == ["A:4"]


@pytest.mark.parametrize("dock", ["nowhere", ""])
def test_an_unknown_dock_has_a_code_and_undocking_elsewhere_has_none(
    domain_id: int, peer: RosPeer, dock: str
) -> None:
    from nav2_msgs.action import DockRobot, UndockRobot  # noqa: PLC0415 - not everywhere

    with simulated_robot(domain_id):
        odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
        outcomes = []
        for kind, name, request in (
            (UndockRobot, "undock_robot", UndockRobot.Goal()),
            (DockRobot, "dock_robot", DockRobot.Goal(use_dock_id=True, dock_id=dock)),
            (DockRobot, "dock_robot", DockRobot.Goal(use_dock_id=True, dock_id="dock")),
            (UndockRobot, "undock_robot", UndockRobot.Goal()),
        ):
            client = ActionClient(peer.node, kind, name)
            wait_until(client.server_is_ready, what=name)
            outcomes.append(outcome_of(answer_of(client.send_goal_async(request))))
            if len(outcomes) <= 2:
                assert odometry.wait_for().pose.pose.position.x == 0.0
        assert outcomes == [(ABORTED, 0), (ABORTED, 901), (SUCCEEDED, 0), (SUCCEEDED, 0)]


def test_a_late_subscriber_gets_the_pose_at_rest_only_if_it_is_reliable_and_latched(
    domain_id: int, peer: RosPeer
) -> None:
    with simulated_robot(domain_id):
        early = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        early.wait_for()
        kinds = (LATCHED, RELIABLE, BEST_EFFORT, qos_profile_system_default)
        late = [peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", kind) for kind in kinds]
        late[0].wait_for()
        assert all(each.stays_silent(0.3) for each in late)
        assert [len(each.messages) for each in late] == [1, 0, 0, 0]


def test_a_map_is_loaded_during_a_drive(domain_id: int, peer: RosPeer, tmp_path: Path) -> None:
    from nav2_msgs.srv import LoadMap  # noqa: PLC0415 - not everywhere

    (tmp_path / "map.pgm").write_bytes(b"P5 80 80 255 " + bytes([254] * 6400))
    good, no_image = tmp_path / "map.yaml", tmp_path / "no_image.yaml"
    good.write_text("image: map.pgm\nresolution: 0.5\norigin: [-10.0, -10.0, 0.0]\n", encoding="utf-8")
    no_image.write_text("image: no.pgm\nresolution: 0.5\norigin: [-10.0, -10.0, 0.0]\n", encoding="utf-8")
    with simulated_robot(domain_id):
        client = Client(peer)
        handle = client.send((20.0, 0.0))
        load = peer.client(LoadMap, "map_server/load_map")
        files = [str(good), "", str(tmp_path / "missing.yaml"), str(no_image)]
        results = [peer.call(load, LoadMap.Request(map_url=each)).result for each in files]
        assert results == [0, 1, 3, 2]
        assert outcome_of(handle) == (SUCCEEDED, 0)
