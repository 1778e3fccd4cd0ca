"""Faults of a simulated robot as another node sees them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from sensor_msgs.msg import BatteryState
from std_msgs.msg import String
from std_srvs.srv import Empty, Trigger

from support.ros import BEST_EFFORT, LATCHED, Inbox, RosPeer
from support.simulator import goal, heard, publisher_to, simulated_robot, trace
from support.waiting import wait_until

pytestmark = pytest.mark.ros

STATUS = "navigate_to_pose/_action/status"


class Faults:
    """Switches faults on and off."""

    def __init__(self, peer: RosPeer) -> None:
        self._peer = peer
        self._publisher = publisher_to(peer, String, "simulator/fault")

    def publish(self, text: str) -> None:
        self._publisher.publish(String(data=text))

    @contextmanager
    def on(self, kind: str) -> Iterator[None]:
        self.publish(f'{{"kind": "{kind}"}}')
        heard(self._peer)
        yield
        self.publish(f'{{"kind": "{kind}", "active": false}}')


@pytest.fixture
def faults(domain_id: int, peer: RosPeer) -> Iterator[Faults]:
    with simulated_robot(domain_id):
        yield Faults(peer)


@pytest.fixture
def arrays(peer: RosPeer) -> Inbox[Any]:
    return peer.subscribe(GoalStatusArray, STATUS, LATCHED)


def servers(peer: RosPeer) -> set[bytes]:
    return {bytes(each.endpoint_gid) for each in peer.node.get_publishers_info_by_topic(f"/{STATUS}")}


def test_reconfigured_navigator_is_a_new_server(faults: Faults, peer: RosPeer, arrays: Inbox[Any]) -> None:
    active = peer.client(Trigger, "lifecycle_manager_navigation/is_active")
    publisher_to(peer, PoseStamped, "goal_pose").publish(goal(35.0, 0.0))
    wait_until(lambda: trace(arrays.messages) == ["A:2"], what="the drive")
    before = servers(peer)
    with faults.on("unconfigured"):
        wait_until(lambda: not servers(peer), what="the end of the server")
        assert not peer.call(active, Trigger.Request()).success
        wait_until(lambda: peer.node.count_subscribers("/goal_pose") == 0, what="nobody that takes goals")
    wait_until(lambda: len(servers(peer)) == 1, what="the next server")
    assert servers(peer).isdisjoint(before)
    wait_until(lambda: peer.call(active, Trigger.Request()).success, what="an active Nav2")
    assert trace(arrays.messages) == ["A:2"]
    publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 3.0))
    arrays.wait_for(lambda array: len(array.status_list) == 1 and array.status_list[0].status == 4)


def test_goal_first_seen_with_its_result(faults: Faults, peer: RosPeer, arrays: Inbox[Any]) -> None:
    publisher = publisher_to(peer, PoseStamped, "goal_pose")
    with faults.on("terminal_first"):
        publisher.publish(goal(1.0, 0.0))
        wait_until(lambda: trace(arrays.messages) == ["A:4"], what="the end alone")


@pytest.mark.parametrize(
    ("kind", "end"),
    [("duplicate_status", ["A:4", "A:4"]), ("reordered_status", ["A:4", "A:2", "A:4"])],
)
def test_newest_array_is_published_last(
    faults: Faults, peer: RosPeer, arrays: Inbox[Any], kind: str, end: list[str]
) -> None:
    publisher = publisher_to(peer, PoseStamped, "goal_pose")
    with faults.on(kind):
        publisher.publish(goal(1.0, 0.0))
        wait_until(lambda: trace(arrays.messages)[-len(end) :] == end, what=f"all that ends it: {end}")
        assert arrays.stays_silent(0.2)
    assert trace(arrays.messages)[-1] == "A:4"


def test_non_finite_and_displaced_estimates(faults: Faults, peer: RosPeer) -> None:
    poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
    fresh = peer.client(Empty, "request_nomotion_update")
    with faults.on("nan_pose"):
        peer.call(fresh, Empty.Request())
        poses.wait_for(lambda message: math.isnan(message.pose.pose.position.x))
    with faults.on("pose_jump"):
        peer.call(fresh, Empty.Request())
        poses.wait_for(lambda message: message.pose.pose.position.x > 2.5)


def test_battery_uses_the_other_scale(faults: Faults, peer: RosPeer) -> None:
    battery = peer.subscribe(BatteryState, "battery_state", BEST_EFFORT)
    battery.wait_for(lambda message: message.percentage <= 1.0)
    with faults.on("battery_scale"):
        battery.wait_for(lambda message: message.percentage > 50.0)


def test_frozen_robot_answers_when_it_continues(faults: Faults, peer: RosPeer) -> None:
    active = peer.client(Trigger, "lifecycle_manager_navigation/is_active")
    battery = peer.subscribe(BatteryState, "battery_state", BEST_EFFORT)
    battery.wait_for()
    faults.publish('{"kind": "freeze", "seconds": 2.0}')
    wait_until(lambda: battery.stays_silent(1.5), what="silence")
    assert peer.call(active, Trigger.Request()).success
