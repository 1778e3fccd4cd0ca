"""Client of one of Nav2's action servers: goals, results, feedback, statuses and cancelling.

It uses the action's hidden services and topics, so that goals have IDs of our own, calls have timeouts, and
the result of an earlier run's goal can be requested. Statuses and cancelling need no types of Nav2: they also
serve goals sent by topic.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.qos import QoSProfile, ReliabilityPolicy

from nena_edge_agent.driver.port import DriveGoal
from nena_edge_agent.nav2 import messages
from nena_edge_agent.nav2.goals import FeedbackReading, GoalEntry, GoalResult
from nena_edge_agent.nav2.messages import UnusablePoseError
from nena_edge_agent.nav2.presence import endpoints
from nena_edge_agent.nav2.session import LATCHED, STATUS_ARRAYS, RosSession
from nena_edge_agent.nav2.settings import Navigation, RosSettings, status_of
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


@dataclass(frozen=True, slots=True)
class ActionHandlers:
    """What receives the messages of an action's server, in the event loop."""

    on_statuses: Callable[[list[GoalEntry]], None]
    on_result: Callable[[GoalResult], None]
    on_feedback: Callable[[FeedbackReading], None]


class ActionClient:
    """Client of an action server: a node extension whose :meth:`enter` is called before any other method.

    Without ``types``, goals cannot be sent, and there are neither results nor feedback.
    """

    def __init__(
        self,
        settings: RosSettings,
        name: str,
        types: Any | None,  # noqa: ANN401 - rclpy carries no types
        handlers: ActionHandlers,
    ) -> None:
        """Prepare for the action ``name``."""
        self._settings = settings
        self._name = name
        self._types = types
        self._handlers = handlers
        self._goals: Any = None
        self._result_request: Any = None
        self._feedback_due_at = 0.0

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401
        """Create the clients and the subscriptions."""
        self._session, self._node = session, node
        hidden = f"{self._name}/_action"
        self._cancels = node.create_client(CancelGoal, f"{hidden}/cancel_goal")
        session.subscribe(
            node,
            GoalStatusArray,
            status_of(self._name),
            LATCHED,
            read=messages.status_entries,
            handle=self._handlers.on_statuses,
            limit=STATUS_ARRAYS,
        )
        if self._types is None:
            return
        services = self._types.Impl
        self._goals = node.create_client(services.SendGoalService, f"{hidden}/send_goal")
        self._results = node.create_client(services.GetResultService, f"{hidden}/get_result")
        session.subscribe(
            node,
            services.FeedbackMessage,
            f"{hidden}/feedback",
            FEEDBACK,
            read=feedback_reading,
            handle=self._handlers.on_feedback,
            due=self._is_feedback_due,
        )

    @property
    def is_ready(self) -> bool:
        """Return whether a server is present that accepts goals."""
        if self._goals is None:
            return False
        # server_is_ready stays true for 20 s after a crash, so a restart is seen by the endpoint IDs instead.
        return bool(self._goals.service_is_ready() and self._results.service_is_ready())

    def server_ids(self) -> frozenset[str]:
        """Return the endpoint IDs of the status array's publishers."""
        return endpoints(self._node.get_publishers_info_by_topic(status_of(self._name)))

    async def send_goal(self, goal: DriveGoal, goal_id: str) -> bool | None:
        """Send a goal; return whether the server has accepted it, None: it did not answer in time."""
        if self._types is None or self._goals is None:
            return None
        request = self._types.Impl.SendGoalService.Request()
        request.goal_id.uuid = list(bytes.fromhex(goal_id))
        self._fill_goal(request.goal, goal)
        answer = await self._session.call(self._goals, request, seconds=self._settings.call_timeout)
        return None if answer is None else bool(answer.accepted)

    def _fill_goal(self, message: Any, goal: DriveGoal) -> None:  # noqa: ANN401
        """Fill the goal of a FollowPath, NavigateToPose or NavigateThroughPoses."""
        frame = self._settings.frame
        if hasattr(message, "path"):
            message.path.header.frame_id = frame
            message.path.poses = [messages.goal_message(pose, frame) for pose in goal.path]
            return
        poses = [messages.goal_message(pose, frame) for pose in (goal.pose, *goal.ahead)]
        if hasattr(message, "pose"):
            message.pose = poses[0]
        elif hasattr(message.poses, "goals"):  # nav_msgs/Goals, from Kilted on
            message.poses.header.frame_id = frame
            message.poses.goals = poses
        else:
            message.poses = poses
        message.behavior_tree = self._settings.behavior_trees.get(goal.behavior_tree, "")

    async def cancel_goal(self, goal_id: str) -> int | None:
        """Cancel one goal and return the code of the answer; None: it did not answer in time."""
        request = messages.cancel_request(goal_id)
        answer = await self._session.call(self._cancels, request, seconds=self._settings.call_timeout)
        return None if answer is None else int(answer.return_code)

    def request_result(self, goal_id: str) -> None:
        """Request the result of a goal, which arrives when it ends; an earlier request is dropped."""
        if self._types is None or self._goals is None:
            return
        # A pending request would stay in the client for ever if its server dies.
        if self._result_request is not None:
            self._results.remove_pending_request(self._result_request)
        request = self._types.Impl.GetResultService.Request()
        request.goal_id.uuid = list(bytes.fromhex(goal_id))
        self._result_request = self._results.call_async(request)
        self._result_request.add_done_callback(lambda future: self._pass_result(goal_id, future.result()))

    def _is_feedback_due(self) -> bool:
        # Deserialising each message of 100 Hz would take most of the time of this thread.
        now = time.monotonic()
        if now < self._feedback_due_at:
            return False
        self._feedback_due_at = now + FEEDBACK_PERIOD
        return True

    def _pass_result(self, goal_id: str, answer: Any) -> None:  # noqa: ANN401
        """Pass a result to the event loop; runs in the ROS thread, also for a request without an answer."""
        if answer is None:
            return
        # Over action_server_result_timeout (900 s) Nav2 answers status 0, code 0: GoalStatus.UNKNOWN.
        outcome = answer.result
        # Humble has neither field, Iron the code alone.
        code, message = getattr(outcome, "error_code", None), str(getattr(outcome, "error_msg", ""))
        reason = None if code is None else (int(code), message)
        result = GoalResult(goal_id, GoalStatus.of(answer.status), reason)
        self._session.post(lambda: self._handlers.on_result(result))


def feedback_reading(message: Any) -> FeedbackReading:  # noqa: ANN401
    """Read the feedback of a drive; that of a path contains no position.

    Raises:
        UnusablePoseError: a number is not finite or the orientation no unit quaternion.
    """
    goal_id, feedback = bytes(message.goal_id.uuid).hex(), message.feedback
    if hasattr(feedback, "distance_to_goal"):  # nav2_msgs/FollowPath
        if not math.isfinite(feedback.distance_to_goal):
            raise UnusablePoseError(f"distance {feedback.distance_to_goal}")
        return FeedbackReading(goal_id, 0.0, 0.0, 0.0, "", left=feedback.distance_to_goal, recoveries=0)
    position, turn = feedback.current_pose.pose.position, feedback.current_pose.pose.orientation
    yaw = yaw_of(turn.x, turn.y, turn.z, turn.w)
    if yaw is None or not math.isfinite(position.x + position.y + feedback.distance_remaining):
        raise UnusablePoseError(f"x {position.x}, y {position.y}, distance {feedback.distance_remaining}")
    return FeedbackReading(
        goal_id=goal_id,
        x=position.x,
        y=position.y,
        yaw=yaw,
        frame=feedback.current_pose.header.frame_id,
        left=feedback.distance_remaining,
        recoveries=feedback.number_of_recoveries,
        places_left=getattr(feedback, "number_of_poses_remaining", 1),
    )
