"""The controller's action server in the ROS graph: the navigator's goal there, and other paths."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from uuid import UUID

from nena_robot_simulator import messages
from nena_robot_simulator.action_server import ActionEndpoints
from nena_robot_simulator.goals import Action, GoalEntry, Snapshot
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.servers import Server
from nena_robot_simulator.session import RosSession
from nena_shared.clock import Clock
from nena_shared.log import get_logger

log = get_logger(__name__)


class ControllerServer:
    """The server of one robot, closed initially. Without ``types``, its goals can only be cancelled.

    ``take`` accepts a goal and returns the time of acceptance (UTC, ns), or None if it is rejected.
    """

    def __init__(
        self,
        session: RosSession,
        robot: Robot,
        types: Any | None,  # noqa: ANN401 - rclpy carries no types
        clock: Clock,
        *,
        take: Callable[[Goal, Action], int | None],
    ) -> None:
        self._robot = robot
        self._clock = clock
        self._take = take
        self._endpoints = ActionEndpoints(session, Action.FOLLOW_PATH, types, self)
        self._there = False

    @property
    def hangs(self) -> bool:
        """Whether the server answers nothing, as if it hung."""
        return not self._robot.servers.runs(Server.CONTROLLER)

    def show(self) -> None:
        """Join or leave the ROS graph, depending on whether the process runs and is configured."""
        # Endpoints of a killed process stay until its DDS lease ends, 19 to 20 s later.
        if self._robot.servers.listed(Server.CONTROLLER):
            return
        there = self._robot.servers.configured(Server.CONTROLLER)
        if there and not self._there:
            self._endpoints.open()
        elif self._there and not there:
            self._endpoints.close()
        self._there = there

    def publish(self, snapshot: Snapshot) -> None:
        """Publish a status array."""
        if self._there:
            self._endpoints.publish(snapshot)

    def answer(self) -> None:
        """Answer the waiting result requests of goals that have ended."""
        if self._there:
            self._endpoints.answer()

    def publish_progress(self, frame_id: str, nanoseconds: int) -> None:
        """Publish the feedback of the followed path, if it has a subscriber."""
        progress = self._robot.feedback(Action.FOLLOW_PATH, self._clock.monotonic())
        if progress is not None and self._endpoints.wants_feedback:
            self._endpoints.publish_feedback(progress, frame_id, nanoseconds)

    def on_goal(self, action: Action, goal: Goal) -> int | None:
        """Accept a path; return the time of acceptance (UTC, ns), or None if it is rejected."""
        return None if self.find(action, goal.goal_id) is not None else self._take(goal, action)

    def find(self, action: Action, goal_id: UUID) -> GoalEntry | None:
        """Return a known path."""
        return self._robot.goals(action).find(goal_id, self._clock.monotonic())

    def on_cancel(self, action: Action, request: Any, response: Any) -> None:  # noqa: ANN401
        """Cancel matching paths; if none matches, cancel the navigator's goal, whichever goal is named."""
        goal_id = messages.goal_id_of(request.goal_info)
        stamp = messages.nanoseconds_of(request.goal_info.stamp)
        answer = self._robot.cancel(goal_id, stamp, self._clock.monotonic(), action)
        # Only the navigator knows the ID, and it may have died: an empty request stops Nav2 too (measured).
        had_one = not answer.goals and self._robot.cancel_controller()
        response.return_code = 0 if had_one else int(answer.code)
        response.goals_canceling = [messages.goal_info(goal) for goal in answer.goals]
        if had_one:
            response.goals_canceling = [request.goal_info]
        log.info("goal cancelled", server=Server.CONTROLLER.value, paths=len(answer.goals), had_one=had_one)
