"""One action of bt_navigator in the ROS graph: its goals, results, feedback, statuses, and cancelling.

Made of ordinary topics and services with the hidden names of an action, so that the navigator's own rules
decide what they say, and not the habits of rclpy's server.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol
from uuid import UUID

from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from nena_robot_simulator import action_messages, messages
from nena_robot_simulator.action import Action
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.session import RosSession
from nena_robot_simulator.status_array import GoalEntry, Snapshot

LATCHED = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
FEEDBACK = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
QUESTIONS = 100
"""Requests for results that may wait; a newer one is left without an answer above that."""

Answer = Callable[[Any], None]


class ActionServer(Protocol):
    """Who decides on what comes in."""

    @property
    def hangs(self) -> bool:
        """Whether the server answers nothing."""
        ...

    def on_goal(self, action: Action, goal: Goal) -> int | None:
        """Take a goal; gives the time of its acceptance (UTC, ns), None: it is refused."""
        ...

    def on_cancel(self, action: Action, request: Any, response: Any) -> None:  # noqa: ANN401
        """Answer a CancelGoal request."""
        ...

    def find(self, action: Action, goal_id: UUID) -> GoalEntry | None:
        """Give a goal that is remembered."""
        ...


class ActionEndpoints:
    """The topics and services of one action; without its ``types`` its statuses and cancelling alone."""

    def __init__(self, session: RosSession, action: Action, types: Any | None, server: ActionServer) -> None:  # noqa: ANN401
        self._session = session
        self._action = action
        self._types = types
        self._server = server
        self._status: Any = None
        self._feedback: Any = None
        self._others: list[Any] = []
        self._questions: list[tuple[UUID, Answer]] = []

    def open(self) -> None:
        """Appear in the graph as a new server."""
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
        """Leave the graph; who waits for a result gets none."""
        for entity in (self._status, self._feedback, *self._others):
            self._session.destroy(entity)
        self._status, self._feedback, self._others, self._questions = None, None, [], []

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status array, if the server is there."""
        if self._status is not None:
            self._status.publish(messages.status_array(snapshot))

    def answer(self) -> None:
        """Answer those who wait for the result of a goal that has ended meanwhile."""
        waiting, self._questions = self._questions, []
        for goal_id, answer in waiting:
            self._answer_or_keep(goal_id, answer)

    @property
    def wants_feedback(self) -> bool:
        """Whether anybody listens to the feedback."""
        return self._feedback is not None and self._feedback.get_subscription_count() > 0

    def publish_feedback(self, feedback: Feedback, frame_id: str, nanoseconds: int) -> None:
        """Tell how the drive stands."""
        message = action_messages.feedback_message(self._types, feedback, frame_id, nanoseconds)
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
        stamp = self._server.on_goal(self._action, action_messages.goal_of(request, self._action))
        response.accepted = stamp is not None
        response.stamp = messages.stamp_of(stamp or 0)
        answer(response)

    def _on_get_result(self, request: Any, answer: Answer) -> None:  # noqa: ANN401
        if len(self._questions) < QUESTIONS:
            self._answer_or_keep(action_messages.goal_id_of(request), answer)

    def _answer_or_keep(self, goal_id: UUID, answer: Answer) -> None:
        entry = self._server.find(self._action, goal_id)
        if entry is not None and not entry.ended:
            self._questions.append((goal_id, answer))
            return
        response = self._types.Impl.GetResultService.Response() if self._types else None
        action_messages.fill_result(response, entry)
        answer(response)
