"""The servers of bt_navigator's actions in the ROS graph: goals, results, feedback, status and cancel.

They use the hidden topics and services of an action directly, so that the navigator's rules decide their
content instead of the behaviour of rclpy's server.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any, Protocol
from uuid import UUID

from action_msgs.msg import GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_system_default

from nena_robot_simulator import messages
from nena_robot_simulator.goals import Action, GoalEntry, Snapshot
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.session import RosSession
from nena_shared.ros import GoalStatus as Status

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


# rcl_action's default for a status topic: late clients receive the last array, and only that.
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
        # Measured: results asked of a killed server never arrive, not even after its restart.
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
        if not self._server.hangs and len(self._result_requests) < RESULT_REQUESTS:
            self._answer_or_keep(messages.goal_id_of(request), answer)

    def _answer_or_keep(self, goal_id: UUID, answer: Answer) -> None:
        entry = self._server.find(self._action, goal_id)
        if entry is not None and not entry.ended:
            self._result_requests.append((goal_id, answer))
            return
        response = self._types.Impl.GetResultService.Response() if self._types else None
        messages.fill_result(response, entry)
        answer(response)


RESULTS_KEPT = 100
"""Maximum number of results of ended goals that a client can still ask for."""


class SimpleAction:
    """The endpoints of an action that executes one goal at a time; ``name`` is its name in the ROS graph."""

    def __init__(self, session: RosSession, name: str, kind: Any) -> None:  # noqa: ANN401
        self.name = name
        self._session = session
        self._kind = kind
        self._status: Any = None
        self._feedback: Any = None
        self._ended: dict[UUID, tuple[Status, Any]] = {}
        self._waiting: list[tuple[UUID, Answer]] = []
        self._active: set[UUID] = set()

    def open(self, begin: Callable[[UUID, Any], bool], cancel: Callable[[UUID], bool] | None) -> list[Any]:
        """Join the ROS graph.

        ``begin`` starts a goal, and returns whether it is accepted; ``cancel`` ends the one at hand, and
        returns whether it was the requested one; None: another one serves the cancelling.
        """
        hidden, services, serve = f"{self.name}/_action", self._kind.Impl, self._session.serve_later

        def on_goal(request: Any, answer: Answer) -> None:  # noqa: ANN401
            goal_id = messages.goal_id_of(request)
            self._active.add(goal_id)  # before it begins, because it may end at once
            accepted = begin(goal_id, request.goal)
            if not accepted:
                self._active.discard(goal_id)
            answer(services.SendGoalService.Response(accepted=accepted))

        def on_result(request: Any, answer: Answer) -> None:  # noqa: ANN401
            if len(self._waiting) < RESULT_REQUESTS:
                self._waiting.append((messages.goal_id_of(request), answer))
                self._answer()

        def on_cancel(request: Any, answer: Answer) -> None:  # noqa: ANN401
            cancelled = cancel is not None and cancel(messages.goal_id_of(request.goal_info))
            answer(CancelGoal.Response(goals_canceling=[request.goal_info] if cancelled else []))

        self._status = self._session.publisher(GoalStatusArray, f"{hidden}/status", LATCHED)
        self._feedback = self._session.publisher(services.FeedbackMessage, f"{hidden}/feedback", FEEDBACK)
        return [
            self._status,
            self._feedback,
            serve(services.SendGoalService, f"{hidden}/send_goal", on_goal),
            serve(services.GetResultService, f"{hidden}/get_result", on_result),
            *([serve(CancelGoal, f"{hidden}/cancel_goal", on_cancel)] if cancel else []),
        ]

    def result(self) -> Any:  # noqa: ANN401
        """Return an empty result."""
        return self._kind.Result()

    def show(self, goal_id: UUID, status: Status) -> None:
        """Publish the status of the newest goal."""
        entry = GoalStatus(status=int(status))
        entry.goal_info.goal_id.uuid = list(goal_id.bytes)
        self._status.publish(GoalStatusArray(status_list=[entry]))

    def publish_feedback(self, goal_id: UUID, **fields: Any) -> None:  # noqa: ANN401
        """Publish feedback with these fields."""
        message = self._kind.Impl.FeedbackMessage(feedback=self._kind.Feedback(**fields))
        message.goal_id.uuid = list(goal_id.bytes)
        self._feedback.publish(message)

    def end(self, goal_id: UUID, status: Status, result: Any) -> None:  # noqa: ANN401
        """End a goal, and answer the clients that wait for it."""
        self._active.discard(goal_id)
        self._ended[goal_id] = (status, result)
        if len(self._ended) > RESULTS_KEPT:
            del self._ended[next(iter(self._ended))]
        self.show(goal_id, status)
        self._answer()

    def _answer(self) -> None:
        waiting, self._waiting = self._waiting, []
        for goal_id, answer in waiting:
            if goal_id in self._active:
                self._waiting.append((goal_id, answer))
                continue
            # as rcl_action, which answers at once with status 0 for a goal that it does not know
            status, result = self._ended.get(goal_id, (Status.UNKNOWN, self.result()))
            answer(self._kind.Impl.GetResultService.Response(status=int(status), result=result))


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
        # Nav2's profile, which Fast DDS makes best effort: 29 % of goals were lost with 20 % of the packets.
        self._goal_pose = self._session.subscribe(
            PoseStamped, "goal_pose", self._on_goal_pose, qos_profile_system_default
        )

    def _close(self) -> None:
        for endpoints in self._actions.values():
            endpoints.close()
        self._session.destroy(self._goal_pose)
        self._goal_pose = None
