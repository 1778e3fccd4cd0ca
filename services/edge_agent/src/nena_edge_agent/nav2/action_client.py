"""Client of Nav2's action NavigateToPose or NavigateThroughPoses: goals, results and feedback.

It uses the action's hidden services and topic, so that goals have IDs of our own, calls have timeouts, and
the result of an earlier run's goal can be requested. Statuses and cancelling are in the node, which needs
them for goals by topic as well.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from rclpy.qos import QoSProfile, ReliabilityPolicy

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.nav2 import messages
from nena_edge_agent.nav2.goals import FeedbackReading, GoalResult
from nena_edge_agent.nav2.messages import UnusablePoseError
from nena_edge_agent.nav2.session import RosSession
from nena_edge_agent.nav2.settings import Navigation, RosSettings
from nena_shared.ros import GoalStatus, yaw_of

FEEDBACK_PERIOD = 0.05
"""Minimum interval between feedback messages that are read, seconds; Nav2 sends one every 10 ms."""
FEEDBACK = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)


def action_type(navigation: Navigation) -> Any | None:  # noqa: ANN401 - rclpy carries no types
    """Return the type of the action for goals; None if the robot's ROS installation lacks it."""
    name = "NavigateThroughPoses" if navigation is Navigation.THROUGH_POSES else "NavigateToPose"
    try:
        return getattr(import_module("nav2_msgs.action"), name)
    except ImportError:
        return None


class ActionClient:
    """Client of an action server: a node extension whose :meth:`enter` is called before any other method."""

    def __init__(
        self,
        settings: RosSettings,
        types: Any,  # noqa: ANN401 - rclpy carries no types
        *,
        on_result: Callable[[GoalResult], None],
        on_feedback: Callable[[FeedbackReading], None],
    ) -> None:
        """Prepare; the handlers are called in the event loop."""
        self._settings = settings
        self._types = types
        self._handle_result, self._handle_feedback = on_result, on_feedback
        self._name = settings.action
        self._read_feedback = feedback_reading
        self._result_request: Any = None
        self._feedback_due_at = 0.0

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        """Create the clients and the subscription."""
        self._session, self._node = session, node
        services, hidden = self._types.Impl, f"{self._name}/_action"
        self._goals = node.create_client(services.SendGoalService, f"{hidden}/send_goal")
        self._results = node.create_client(services.GetResultService, f"{hidden}/get_result")
        session.subscribe(
            node,
            services.FeedbackMessage,
            f"{hidden}/feedback",
            FEEDBACK,
            read=self._read_feedback,
            handle=self._handle_feedback,
            due=self._feedback_due,
        )

    @property
    def ready(self) -> bool:
        """Return whether a server is present that accepts goals."""
        return bool(self._goals.service_is_ready() and self._results.service_is_ready())

    async def send(self, goal_id: str, way: Sequence[Pose], tree: str = "") -> bool | None:
        """Send a goal through the positions of ``way``; NavigateToPose uses only the first.

        ``tree`` is the name of a behaviour tree of the settings; "": Nav2's own.

        Return whether the server has accepted it, None: it did not answer in time.
        """
        request = self._goal_request(goal_id)
        poses = [messages.goal_message(pose, self._settings.frame) for pose in way]
        if hasattr(request.goal, "pose"):
            request.goal.pose = poses[0]
        elif hasattr(request.goal.poses, "goals"):  # from Kilted on
            request.goal.poses.header.frame_id = self._settings.frame
            request.goal.poses.goals = poses
        else:
            request.goal.poses = poses
        request.goal.behavior_tree = self._settings.behavior_trees.get(tree, "")
        return await self._send(request)

    def _goal_request(self, goal_id: str) -> Any:  # noqa: ANN401
        request = self._types.Impl.SendGoalService.Request()
        request.goal_id.uuid = list(bytes.fromhex(goal_id))
        return request

    async def _send(self, request: Any) -> bool | None:  # noqa: ANN401
        answer = await self._session.call(self._goals, request, seconds=self._settings.call_timeout)
        return None if answer is None else bool(answer.accepted)

    def request_result(self, goal_id: str) -> None:
        """Request the result of a goal, which arrives when it ends; an earlier request is dropped."""
        if self._result_request is not None:
            self._results.remove_pending_request(self._result_request)
        request = self._types.Impl.GetResultService.Request()
        request.goal_id.uuid = list(bytes.fromhex(goal_id))
        self._result_request = self._results.call_async(request)
        self._result_request.add_done_callback(lambda future: self._on_result(goal_id, future.result()))

    def _feedback_due(self) -> bool:
        now = time.monotonic()
        if now < self._feedback_due_at:
            return False
        self._feedback_due_at = now + FEEDBACK_PERIOD
        return True

    def _on_result(self, goal_id: str, answer: Any) -> None:  # noqa: ANN401
        """Pass a result to the event loop; runs in the ROS thread, also for a request without an answer."""
        if answer is None:
            return
        outcome = answer.result
        # Humble has neither field, Iron the code alone.
        code, message = getattr(outcome, "error_code", None), str(getattr(outcome, "error_msg", ""))
        reason = None if code is None else (int(code), message)
        result = GoalResult(goal_id, GoalStatus.of(answer.status), reason)
        self._session.post(lambda: self._handle_result(result))


def feedback_reading(message: Any) -> FeedbackReading:  # noqa: ANN401
    """Read the feedback of a drive.

    Raises:
        UnusablePoseError: the position is not finite or the orientation no unit quaternion.

    """
    feedback = message.feedback
    position, turn = feedback.current_pose.pose.position, feedback.current_pose.pose.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    if yaw is None or not math.isfinite(position.x + position.y + feedback.distance_remaining):
        text = f"x {position.x}, y {position.y}, distance {feedback.distance_remaining}"
        raise UnusablePoseError(text)
    return FeedbackReading(
        goal_id=bytes(message.goal_id.uuid).hex(),
        x=position.x,
        y=position.y,
        yaw=yaw,
        frame=feedback.current_pose.header.frame_id,
        left=feedback.distance_remaining,
        recoveries=feedback.number_of_recoveries,
        places_left=getattr(feedback, "number_of_poses_remaining", 1),
    )
