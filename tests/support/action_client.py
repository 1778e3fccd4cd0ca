"""rclpy's own action client, as a peer independent of NeNa."""

from __future__ import annotations

import threading
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from support.ros import Inbox, RosPeer
from support.simulator import goal, heard
from support.waiting import PATIENCE, wait_until

Outcome = tuple[int, int]
"""Status and error code of a result."""
SUCCEEDED, CANCELED, ABORTED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_CANCELED,
    GoalStatus.STATUS_ABORTED,
)


class Client:
    """Sends goals to one action and waits for their results."""

    def __init__(self, peer: RosPeer, action: Action = Action.TO_POSE) -> None:
        self._types = action_types()[action]
        self.ros = ActionClient(peer.node, self._types, action)
        wait_until(self.ros.server_is_ready, what=f"the server of {action}")
        heard(peer)  # the robot knows that feedback is listened to
        self.feedback: Inbox[Any] = Inbox()

    def send(self, *places: tuple[float, float], goal_id: Any = None, frame: str = "map") -> Any:
        """Send a goal; return its handle, which shows whether it is accepted."""
        request = self._types.Goal()
        stamped = [goal(x, y, frame=frame) for x, y in places]
        if hasattr(request, "poses"):
            request.poses = stamped
        else:
            request.pose = stamped[0]
        return answer_of(self.ros.send_goal_async(request, self._hear, goal_id))

    def _hear(self, message: Any) -> None:
        self.feedback.add(message.feedback)


def answer_of(future: Any, *, timeout: float = PATIENCE) -> Any:
    """Wait for one of rclpy's futures."""
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    assert done.wait(timeout), "rclpy gave no answer"
    return future.result()


def outcome_of(handle: Any) -> Outcome:
    """Wait for the end of a goal."""
    answer = answer_of(handle.get_result_async())
    return answer.status, answer.result.error_code
