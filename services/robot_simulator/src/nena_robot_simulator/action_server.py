"""The servers of bt_navigator's actions in the ROS graph: goals, results, feedback, status and cancel.

They use the hidden topics and services of an action directly, so that the navigator's rules decide their
content instead of the behaviour of rclpy's server.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Protocol
from uuid import UUID

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_system_default

from nena_robot_simulator import messages
from nena_robot_simulator.goals import Action, GoalEntry, Snapshot
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.session import RosSession

_NAMES = {
    Action.TO_POSE: "NavigateToPose",
    Action.THROUGH_POSES: "NavigateThroughPoses",
    Action.FOLLOW_PATH: "FollowPath",
}


def action_types() -> dict[Action, Any]:
    """Return the type of each action; empty if ``nav2_msgs`` is not installed."""
    try:
        module = import_module("nav2_msgs.action")
    except ImportError:
        return {}
    return {action: getattr(module, name) for action, name in _NAMES.items()}


LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
FEEDBACK = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
RESULT_REQUESTS = 100
"""Maximum number of waiting result requests; further ones get no response."""

Answer = Callable[[Any], None]


class ActionServer(Protocol):
    """Handles goals and cancel requests."""

    @property
    def hangs(self) -> bool:
        """Whether the server answers nothing, as if it hung."""
        ...

    def on_goal(self, action: Action, goal: Goal) -> int | None:
        """Accept a goal; return the time of acceptance (UTC, ns), or None if it is rejected."""
        ...

    def on_cancel(self, action: Action, request: Any, response: Any) -> None:  # noqa: ANN401
        """Answer a CancelGoal request."""
        ...

    def find(self, action: Action, goal_id: UUID) -> GoalEntry | None:
        """Return a known goal."""
        ...


class ActionEndpoints:
    """The topics and services of one action; without ``types`` only status and cancel."""

    def __init__(self, session: RosSession, action: Action, types: Any | None, server: ActionServer) -> None:  # noqa: ANN401
        self._session = session
        self._action = action
        self._types = types
        self._server = server
        self._status: Any = None
        self._feedback: Any = None
        self._others: list[Any] = []
        self._result_requests: list[tuple[UUID, Answer]] = []

    def open(self) -> None:
        """Join the ROS graph as a new server."""
        name, session = f"{self._action}/_action", self._session
        self._status = session.publisher(GoalStatusArray, f"{name}/status", LATCHED)
        self._others = [session.serve_later(CancelGoal, f"{name}/cancel_goal", self._on_cancel)]
        if self._types is not None:
            services = self._types.Impl
            self._feedback = session.publisher(services.FeedbackMessage, f"{name}/feedback", FEEDBACK)
            self._others += [
                session.serve_later(services.SendGoalService, f"{name}/send_goal", self._on_send_goal),
                session.serve_later(services.GetResultService, f"{name}/get_result", self._on_get_result),
            ]

    def close(self) -> None:
        """Leave the ROS graph; waiting result requests get no response."""
        for entity in (self._status, self._feedback, *self._others):
            self._session.destroy(entity)
        self._status, self._feedback, self._others, self._result_requests = None, None, [], []

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status array, if the server is in the graph."""
        if self._status is not None:
            self._status.publish(messages.status_array(snapshot))

    def answer(self) -> None:
        """Answer the waiting result requests of goals that have ended."""
        waiting, self._result_requests = self._result_requests, []
        for goal_id, answer in waiting:
            self._answer_or_keep(goal_id, answer)

    @property
    def wants_feedback(self) -> bool:
        """Whether the feedback has a subscriber."""
        return self._feedback is not None and self._feedback.get_subscription_count() > 0

    def publish_feedback(self, feedback: Feedback, frame_id: str, nanoseconds: int) -> None:
        """Publish feedback."""
        message = messages.feedback_message(self._types, feedback, frame_id, nanoseconds)
        self._feedback.publish(message)

    def _on_cancel(self, request: Any, answer: Answer) -> None:  # noqa: ANN401
        if self._server.hangs:
            return
        response = CancelGoal.Response()
        self._server.on_cancel(self._action, request, response)
        answer(response)

    def _on_send_goal(self, request: Any, answer: Answer) -> None:  # noqa: ANN401
        if self._server.hangs or self._types is None:
            return
        response = self._types.Impl.SendGoalService.Response()
        stamp = self._server.on_goal(self._action, messages.goal_of(request, self._action))
        response.accepted = stamp is not None
        response.stamp = messages.stamp_of(stamp or 0)
        answer(response)

    def _on_get_result(self, request: Any, answer: Answer) -> None:  # noqa: ANN401
        if len(self._result_requests) < RESULT_REQUESTS:
            self._answer_or_keep(messages.goal_id_of(request), answer)

    def _answer_or_keep(self, goal_id: UUID, answer: Answer) -> None:
        entry = self._server.find(self._action, goal_id)
        if entry is not None and not entry.ended:
            self._result_requests.append((goal_id, answer))
            return
        response = self._types.Impl.GetResultService.Response() if self._types else None
        messages.fill_result(response, entry)
        answer(response)


class NavigatorEndpoints:
    """Two actions and the goal topic; closed initially.

    ``types`` are the installed action types. Without them NavigateToPose publishes its status and can be
    cancelled, which is all that driving by topic needs.
    """

    def __init__(
        self,
        session: RosSession,
        server: ActionServer,
        types: Mapping[Action, Any],
        *,
        on_goal_pose: Callable[[Any], None],
    ) -> None:
        self._session = session
        self._on_goal_pose = on_goal_pose
        self._actions = {
            action: ActionEndpoints(session, action, types.get(action), server)
            for action in (Action.TO_POSE, Action.THROUGH_POSES)
            if action is Action.TO_POSE or action in types
        }
        self._goal_pose: Any = None

    def show(self, *, there: bool) -> None:
        """Join or leave the ROS graph; each time, join as a new server with an empty list."""
        if there and self._goal_pose is None:
            self._open()
        elif not there and self._goal_pose is not None:
            self._close()

    def publish(self, action: Action, snapshot: Snapshot) -> None:
        """Publish a status array of an action that is served."""
        if action in self._actions:
            self._actions[action].publish(snapshot)

    def answer(self, action: Action) -> None:
        """Answer the waiting result requests of goals that have ended."""
        if action in self._actions:
            self._actions[action].answer()

    def publish_progress(
        self, feedback: Callable[[Action], Feedback | None], frame_id: str, stamp: Callable[[], int]
    ) -> None:
        """Publish the feedback of the active action, if it has a subscriber."""
        for action, endpoints in self._actions.items():
            progress = feedback(action) if endpoints.wants_feedback else None
            if progress is not None:
                endpoints.publish_feedback(progress, frame_id, stamp())

    def _open(self) -> None:
        for endpoints in self._actions.values():
            endpoints.open()
        self._goal_pose = self._session.subscribe(
            PoseStamped, "goal_pose", self._on_goal_pose, qos_profile_system_default
        )

    def _close(self) -> None:
        for endpoints in self._actions.values():
            endpoints.close()
        self._session.destroy(self._goal_pose)
        self._goal_pose = None
