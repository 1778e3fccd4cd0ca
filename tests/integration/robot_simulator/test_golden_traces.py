"""The recorded conversations of Nav2's action server, over DDS, as an agent sees them.

The status topic keeps only its newest array, so a step between two others may be missed under load; each test
waits for the steps that Nav2 leaves standing and compares what came between.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from std_msgs.msg import String

from nena_robot_simulator import messages
from nena_robot_simulator.robot import TRANSFORM_AHEAD
from support.pausing import pass_time
from support.ros import LATCHED, Inbox, RosPeer
from support.simulator import goal, initial_pose, publisher_to, simulated_robot, trace
from support.waiting import PATIENCE, wait_until

pytestmark = pytest.mark.ros

STATUS = "navigate_to_pose/_action/status"


class Conversation:
    """What an agent has in its hands: the goal topic, the cancel service and the arrays that came."""

    def __init__(self, peer: RosPeer) -> None:
        self.peer = peer
        self.arrays: Inbox[Any] = peer.subscribe(GoalStatusArray, STATUS, LATCHED)
        self.goals = publisher_to(peer, PoseStamped, "goal_pose")
        self.canceller = peer.client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
        wait_until(lambda: peer.node.count_publishers(STATUS) == 1, what="the status publisher")

    def send(self, x: float, y: float, frame: str = "map") -> None:
        self.goals.publish(goal(x, y, frame=frame))

    def see(self, line: str) -> None:
        wait_until(lambda: line in self.trace(), what=f"array '{line}' ({self.trace()})")

    def trace(self) -> list[str]:
        return trace(self.arrays.messages)

    def cancel(self, index: int | None = None, stamp: int = 0) -> Any:
        """Cancel the goal at ``index`` of the newest array, or all."""
        request = CancelGoal.Request()
        request.goal_info.stamp = messages.stamp_of(stamp)
        if index is not None:
            request.goal_info.goal_id = self.arrays.messages[-1].status_list[index].goal_info.goal_id
        return self.peer.call(self.canceller, request)


@pytest.fixture
def conversation(domain_id: int, peer: RosPeer) -> Iterator[Conversation]:
    with simulated_robot(domain_id):
        yield Conversation(peer)


def test_nothing_is_published_before_the_first_goal(conversation: Conversation) -> None:
    assert conversation.arrays.stays_silent(0.5)


def test_plain_drive_and_a_late_joiner_sees_its_end(conversation: Conversation, domain_id: int) -> None:
    conversation.send(1.0, 0.0)
    conversation.see("A:4")
    assert conversation.trace() == ["A:2", "A:4"]
    with RosPeer(domain_id, name="late_joiner") as late:
        latched = late.subscribe(GoalStatusArray, STATUS, LATCHED)
        assert trace([latched.wait_for()]) == ["A:4"]


def test_second_goal_while_driving(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    conversation.send(2.0, 0.0)
    conversation.see("A:6 B:4")
    seen = conversation.trace()
    assert [line for line in seen if line != "A:2 B:2"] == ["A:2", "A:6 B:2", "A:6 B:4"]


def test_of_goals_sent_at_once_the_last_one_is_driven(conversation: Conversation) -> None:
    for x in (30.0, 20.0, 1.0):
        conversation.send(x, 0.0)
    conversation.arrays.wait_for(
        lambda array: array.status_list[-1].status == 4 and all(e.status in {4, 6} for e in array.status_list)
    )


def test_cancel_all(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    answer = conversation.cancel()
    assert (answer.return_code, len(answer.goals_canceling)) == (0, 1)
    conversation.see("A:5")
    assert conversation.trace() == ["A:2", "A:3", "A:5"]


def test_unknown_frame_and_goal_outside_the_map(conversation: Conversation) -> None:
    conversation.send(1.0, 0.0, frame="moon")
    conversation.see("A:6")
    conversation.send(500.0, 0.0)
    conversation.see("A:6 B:6")
    assert set(conversation.trace()) <= {"A:2", "A:6", "A:6 B:2", "A:6 B:6"}


def test_cancel_and_a_new_goal_directly_after_never_drives_both(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    conversation.cancel(0)
    conversation.send(10.0, 0.0)
    last = conversation.arrays.wait_for(
        lambda array: len(array.status_list) == 2 and array.status_list[0].status in {5, 6}
    )
    states = [entry.status for entry in last.status_list]
    assert states in ([5, 2], [5, 6], [6, 2])
    if "A:5" in conversation.trace():  # the new goal came when the old one had ended already
        conversation.see("A:5 B:4")
    elif states[0] == 5:
        conversation.see("A:5 B:6")


def test_deactivated_while_driving(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    faults = publisher_to(conversation.peer, String, "simulator/fault")
    faults.publish(String(data='{"kind": "inactive"}'))
    conversation.see("A:6")
    conversation.send(1.0, 0.0)
    assert conversation.arrays.stays_silent(0.4)
    assert conversation.trace() == ["A:2", "A:6"]
    assert conversation.cancel().return_code == 0


def test_cancel_codes(conversation: Conversation) -> None:
    nothing = conversation.cancel()
    assert (nothing.return_code, len(nothing.goals_canceling)) == (0, 0)
    conversation.send(1.0, 0.0)
    conversation.see("A:4")
    assert conversation.cancel(0).return_code == 3
    unknown = CancelGoal.Request()
    unknown.goal_info.goal_id.uuid = [7] * 16
    assert conversation.peer.call(conversation.canceller, unknown).return_code == 2


def test_cancel_by_time_spares_goals_accepted_later(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    accepted = messages.nanoseconds_of(conversation.arrays.messages[-1].status_list[0].goal_info.stamp)
    assert len(conversation.cancel(stamp=accepted - 1).goals_canceling) == 0
    assert len(conversation.cancel(stamp=accepted).goals_canceling) == 1
    conversation.see("A:5")


def test_retention_passed_is_seen_with_the_next_goal_only(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, result_timeout=0.2):
        conversation = Conversation(peer)
        conversation.send(1.0, 0.0)
        conversation.see("A:4")
        assert conversation.arrays.stays_silent(0.4)
        conversation.send(0.0, 0.0)
        conversation.see("B:4")
    assert conversation.trace() == ["A:2", "A:4", "B:2", "B:4"]


def test_not_localised_then_localised(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, localisation={"known_at_start": False}):
        conversation = Conversation(peer)
        poses = peer.subscribe(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        wait_until(lambda: peer.node.count_publishers("amcl_pose") == 1, what="the pose publisher")
        conversation.send(1.0, 0.0)
        conversation.see("A:6")
        assert poses.stays_silent(0.3)
        publisher_to(peer, PoseWithCovarianceStamped, "initialpose").publish(initial_pose(5.0, 5.0, 1.0))
        pose = messages.pose_of(poses.wait_for().pose.pose)
        assert pose is not None
        assert (pose.x, pose.y, pose.yaw) == pytest.approx((5.0, 5.0, 1.0), abs=0.15)
        pass_time(TRANSFORM_AHEAD)  # on a slow computer Nav2 has had no transform for long
        conversation.send(6.0, 5.0)
        conversation.see("A:6 B:4")


def test_restarted_server_starts_with_an_empty_list(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        conversation = Conversation(peer)
        conversation.send(1.0, 0.0)
        conversation.see("A:4")
    wait_until(lambda: peer.node.count_publishers(STATUS) == 0, what="the end of the first server")
    with simulated_robot(domain_id):
        wait_until(lambda: peer.node.count_publishers(STATUS) == 1, what="the second server")
        assert conversation.arrays.stays_silent(0.3)
        publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 1.0))
        conversation.see("B:2")


def test_answer_comes_after_the_canceling_array(conversation: Conversation) -> None:
    conversation.send(35.0, 0.0)
    conversation.see("A:2")
    done = threading.Event()
    conversation.canceller.call_async(CancelGoal.Request()).add_done_callback(lambda _: done.set())
    conversation.see("A:3")
    assert done.wait(PATIENCE)
