"""Client of the Nav2 controller's action (nav2_msgs/FollowPath): paths, results and feedback."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.nav2 import messages
from nena_edge_agent.nav2.action_client import ActionClient
from nena_edge_agent.nav2.goals import FeedbackReading, GoalEntry, GoalResult
from nena_edge_agent.nav2.messages import UnusablePoseError
from nena_edge_agent.nav2.offers import FOLLOW_PATH, interface
from nena_edge_agent.nav2.presence import endpoints
from nena_edge_agent.nav2.session import LATCHED, STATUS_ARRAYS, RosSession
from nena_edge_agent.nav2.settings import RosSettings, status_of


class PathClient(ActionClient):
    """Client of the controller's action server."""

    def __init__(
        self,
        settings: RosSettings,
        *,
        on_result: Callable[[GoalResult], None],
        on_feedback: Callable[[FeedbackReading], None],
        on_statuses: Callable[[list[GoalEntry]], None],
    ) -> None:
        """Prepare; the handlers are called in the event loop."""
        super().__init__(settings, interface(FOLLOW_PATH), on_result=on_result, on_feedback=on_feedback)
        self._handle_statuses = on_statuses
        self._name = settings.names.follow_path
        self._status = status_of(self._name)
        self._read_feedback = path_feedback

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Create the clients and the subscriptions."""
        super().enter(session, node)
        self._cancel = node.create_client(CancelGoal, f"{self._name}/_action/cancel_goal")
        session.subscribe(
            node,
            GoalStatusArray,
            self._status,
            LATCHED,
            read=messages.status_entries,
            handle=self._handle_statuses,
            limit=STATUS_ARRAYS,
        )

    def servers(self) -> frozenset[str]:
        """Return the endpoint IDs of the publishers of the status array."""
        return endpoints(self._node.get_publishers_info_by_topic(self._status))

    async def send_path(self, goal_id: str, path: Sequence[Pose]) -> bool | None:
        """Send a path; return whether the server has accepted it, None: it did not answer in time."""
        request = self._goal_request(goal_id)
        request.goal.path.header.frame_id = self._settings.frame
        request.goal.path.poses = [messages.goal_message(pose, self._settings.frame) for pose in path]
        return await self._send(request)

    async def cancel(self, goal_id: str) -> int | None:
        """Cancel one path and return the code of the answer; None: it did not answer in time."""
        request = messages.cancel_request(goal_id)
        answer = await self._session.call(self._cancel, request, seconds=self._settings.call_timeout)
        return None if answer is None else int(answer.return_code)


def path_feedback(message: Any) -> FeedbackReading:  # noqa: ANN401
    """Read the feedback of a path, which contains no position.

    Raises:
        UnusablePoseError: the distance is not finite.

    """
    left = message.feedback.distance_to_goal
    if not math.isfinite(left):
        text = f"distance {left}"
        raise UnusablePoseError(text)
    return FeedbackReading(
        bytes(message.goal_id.uuid).hex(), x=0.0, y=0.0, yaw=0.0, frame="", left=left, recoveries=0
    )
