"""Everything about the robot beside its goals, as another process sees it."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from lifecycle_msgs.srv import GetState
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from nav_msgs.srv import GetMap
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from sensor_msgs.msg import BatteryState
from std_msgs.msg import String
from std_srvs.srv import Empty, Trigger
from structlog.testing import capture_logs

from nena_robot_simulator import messages
from support.ros import BEST_EFFORT, LATCHED, RosPeer, own_domain_id
from support.simulator import HALL, goal, initial_pose, publisher_to, simulated_robot, trace
from support.waiting import wait_until

pytestmark = pytest.mark.ros

STATUS = "navigate_to_pose/_action/status"


@pytest.fixture
def robot(domain_id: int) -> Iterator[None]:
    with simulated_robot(domain_id):
        yield


def fault(peer: RosPeer, text: str) -> None:
    publisher_to(peer, String, "simulator/fault").publish(String(data=text))


@pytest.mark.usefixtures("robot")
def test_endpoints_have_nav2s_quality_of_service(peer: RosPeer) -> None:
    def offered(topic: str) -> tuple[Any, Any]:
        wait_until(lambda: bool(peer.node.get_publishers_info_by_topic(topic)), what=topic)
        profile = peer.node.get_publishers_info_by_topic(topic)[0].qos_profile
        return profile.reliability, profile.durability

    def asked(topic: str) -> tuple[Any, Any]:
        wait_until(lambda: bool(peer.node.get_subscriptions_info_by_topic(topic)), what=topic)
        profile = peer.node.get_subscriptions_info_by_topic(topic)[0].qos_profile
        return profile.reliability, profile.durability

    latched = (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
    assert [offered(f"/{topic}") for topic in (STATUS, "amcl_pose", "map")] == [latched] * 3
    assert offered("/plan") == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    assert offered("/odom") == (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
    assert [asked(topic) for topic in ("/goal_pose", "/initialpose")] == [
        (ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
    ] * 2


@pytest.mark.usefixtures("robot")
def test_the_map_is_latched_and_served(peer: RosPeer) -> None:
    grid = peer.subscribe(OccupancyGrid, "map", LATCHED).wait_for()
    assert (grid.info.width, grid.info.height) == (HALL.width, HALL.height)
    assert bytes(grid.data) == HALL.cells
    assert grid.info.origin.position.x == pytest.approx(HALL.origin_x)
    assert grid.header.frame_id == "map"
    served = peer.call(peer.client(GetMap, "map_server/map"), GetMap.Request())
    assert served.map.data == grid.data


@pytest.mark.usefixtures("robot")
def test_a_drive_shows_in_plan_odometry_pose_and_battery(peer: RosPeer) -> None:
    plans = peer.subscribe(Path, "plan")
    odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
    poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
    battery = peer.subscribe(BatteryState, "battery_state", BEST_EFFORT)
    arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
    poses.wait_for()
    full = battery.wait_for().percentage
    wait_until(lambda: peer.node.count_publishers("plan") == 1, what="the plan's publisher")
    publisher_to(peer, PoseStamped, "goal_pose").publish(goal(9.0, 0.0))
    arrays.wait_for(lambda array: array.status_list[0].status == 4)
    odometry.wait_for(lambda message: message.pose.pose.position.x > 8.7 and not message.twist.twist.linear.x)
    plan = plans.wait_for()
    assert plan.poses[-1].pose.position.x == pytest.approx(9.0)
    assert plan.poses[0].pose.position.x < 1.0
    assert max(message.twist.twist.linear.x for message in odometry.messages) == pytest.approx(5.0, abs=0.5)
    along = [message.pose.pose.position.x for message in poses.messages]
    assert along == sorted(along)
    assert len(along) > 5
    covariance = poses.messages[-1].pose.covariance
    assert covariance[0] == covariance[7] == pytest.approx(0.02**2)
    assert covariance[35] == pytest.approx(0.01**2)
    battery.clear()
    assert battery.wait_for(lambda message: message.percentage < full).current < 0.0


@pytest.mark.usefixtures("robot")
def test_a_standing_robot_is_silent_until_a_nomotion_update_is_requested(peer: RosPeer) -> None:
    poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
    poses.wait_for()
    assert poses.stays_silent(0.5)
    peer.call(peer.client(Empty, "request_nomotion_update"), Empty.Request())
    wait_until(lambda: len(poses.messages) == 2, what="a second pose")


@pytest.mark.usefixtures("robot")
def test_an_unusable_initial_pose_changes_nothing(peer: RosPeer) -> None:
    poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
    poses.wait_for()
    publisher = publisher_to(peer, PoseWithCovarianceStamped, "initialpose")
    zero, nan = initial_pose(1.0, 1.0), initial_pose(math.nan, 1.0)
    zero.pose.pose.orientation.w = 0.0
    for message in (zero, nan, initial_pose(1.0, 1.0, frame="odom"), initial_pose(1.0, 1.0, frame="")):
        publisher.publish(message)
        assert poses.stays_silent(0.2)
    publisher.publish(initial_pose(1.0, 1.0))
    wait_until(lambda: len(poses.messages) == 2, what="a pose after a good message")


@pytest.mark.usefixtures("robot")
def test_lifecycle_state_is_served(peer: RosPeer) -> None:
    state = peer.client(GetState, "bt_navigator/get_state")
    active = peer.client(Trigger, "lifecycle_manager_navigation/is_active")
    assert peer.call(state, GetState.Request()).current_state.label == "active"
    assert peer.call(state, GetState.Request()).current_state.id == 3
    assert peer.call(active, Trigger.Request()).success
    fault(peer, '{"kind": "inactive"}')
    wait_until(lambda: not peer.call(active, Trigger.Request()).success, what="inactivity")
    assert peer.call(state, GetState.Request()).current_state.label == "inactive"
    assert peer.call(state, GetState.Request()).current_state.id == 2


@pytest.mark.usefixtures("robot")
def test_silence_hides_everything_and_its_end_shows_the_newest_array(peer: RosPeer) -> None:
    odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
    arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
    goals = publisher_to(peer, PoseStamped, "goal_pose")
    odometry.wait_for()
    fault(peer, '{"kind": "silence"}')
    wait_until(lambda: odometry.stays_silent(0.3), what="silence")
    goals.publish(goal(1.0, 0.0))
    assert arrays.stays_silent(3.0)  # the robot is there by then
    fault(peer, '{"kind": "silence", "active": false}')
    arrays.wait_for()
    assert trace(arrays.messages) == ["A:4"]
    odometry.clear()
    assert odometry.wait_for().pose.pose.position.x > 0.7


@pytest.mark.usefixtures("robot")
def test_unknown_fault_is_refused_and_the_robot_continues(peer: RosPeer) -> None:
    arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
    for text in ("", "no json", '{"kind": "explode"}', '{"kind": "stuck", "goals": 1}'):
        fault(peer, text)
    publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 0.0))
    arrays.wait_for(lambda array: array.status_list[0].status == 4)


@pytest.mark.usefixtures("robot")
def test_a_foreign_goal_appears_in_the_array(peer: RosPeer) -> None:
    arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
    fault(peer, '{"kind": "foreign_goal", "x": 1.0, "y": 0.0}')
    arrays.wait_for(lambda array: array.status_list[0].status == 4)


def test_a_fault_from_the_start(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, faults=({"kind": "unreachable"},)):
        arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
        wait_until(lambda: peer.node.count_publishers(STATUS) == 1, what="the status publisher")
        publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 0.0))
        arrays.wait_for(lambda array: array.status_list[0].status == 6)


def test_a_battery_in_percent(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, battery={"charge": 0.5, "scale": "percent"}):
        battery = peer.subscribe(BatteryState, "battery_state", BEST_EFFORT).wait_for()
    assert battery.percentage == pytest.approx(50.0, abs=0.1)


def test_namespaces_of_one_domain_are_isolated(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, "r1", name="one"), simulated_robot(domain_id, "r2", name="two"):
        first = peer.subscribe(GoalStatusArray, f"/r1/{STATUS}", LATCHED)
        second = peer.subscribe(GoalStatusArray, f"/r2/{STATUS}", LATCHED)
        wait_until(lambda: peer.node.count_publishers(f"/r2/{STATUS}") == 1, what="the second robot")
        publisher_to(peer, PoseStamped, "goal_pose", "r1").publish(goal(1.0, 0.0))
        first.wait_for(lambda array: array.status_list[0].status == 4)
        assert second.messages == []


def test_domains_are_isolated(domain_id: int, peer: RosPeer) -> None:
    with (
        own_domain_id() as other_domain,
        RosPeer(other_domain) as other_peer,
        simulated_robot(domain_id, name="one"),
        simulated_robot(other_domain, name="two"),
    ):
        arrays = [each.subscribe(GoalStatusArray, STATUS, LATCHED) for each in (peer, other_peer)]
        wait_until(lambda: other_peer.node.count_publishers(STATUS) == 1, what="the second robot")
        publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 0.0))
        arrays[0].wait_for(lambda array: array.status_list[0].status == 4)
        assert arrays[1].messages == []


def test_starts_and_stops_leave_no_threads(domain_id: int) -> None:
    with simulated_robot(domain_id):
        pass
    before = threading.active_count()
    for _ in range(10):
        with simulated_robot(domain_id) as robot:
            assert robot.alive
        wait_until(lambda: not robot.alive, what="the end of the thread")
    wait_until(lambda: threading.active_count() == before, what="the end of all threads")


def test_failing_callback_loses_only_its_message(
    domain_id: int, peer: RosPeer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with simulated_robot(domain_id) as robot:
        arrays = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
        goals = publisher_to(peer, PoseStamped, "goal_pose")
        with monkeypatch.context() as broken, capture_logs() as lines:
            broken.setattr(robot, "_robot", None)
            goals.publish(goal(1.0, 0.0))
            wait_until(
                lambda: any(each.get("work") == "_deliver_goals" for each in lines), what="the failure"
            )
        assert arrays.messages == []
        goals.publish(goal(2.0, 0.0))
        arrays.wait_for(lambda array: array.status_list[0].status == 4)


def test_stamps_are_current(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        inbox = peer.subscribe(Odometry, "odom", BEST_EFFORT)
        began = peer.node.get_clock().now().nanoseconds
        message = inbox.wait_for(lambda each: messages.nanoseconds_of(each.header.stamp) > began)
        age = peer.node.get_clock().now().nanoseconds - messages.nanoseconds_of(message.header.stamp)
    assert age >= 0
