"""What of the driver has to do with Nav2's action: a new door for each node, goals and results through it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from nena_edge_agent.driver.map_port import MapGoal
from nena_edge_agent.ros.action_feedback import FeedbackReading
from nena_edge_agent.ros.action_tracker import ActionTracker
from nena_edge_agent.ros.commands import Command
from nena_edge_agent.ros.goal_status import GoalEntry
from nena_edge_agent.ros.settings import Navigation, RosSettings
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.program import StartError

if TYPE_CHECKING:
    from nena_edge_agent.ros.action_door import ActionDoor, GoalResult

log = get_logger(__name__)


class ActionSide:
    """Carries out what the tracker wants of the action, and hands it the answers; ``apply`` does the rest.

    rclpy is loaded with the first door, not before.
    """

    def __init__(
        self,
        tracker: ActionTracker,
        *,
        apply: Callable[[Iterable[Command]], None],
        on_feedback: Callable[[FeedbackReading], None],
        clock: Clock,
    ) -> None:
        self._tracker = tracker
        self._apply = apply
        self._on_feedback = on_feedback
        self._clock = clock
        self._door: ActionDoor | None = None

    @staticmethod
    def check(settings: RosSettings) -> None:
        """See whether the settings ask for what this machine does not have.

        Raises:
            StartError: the action is wanted, and its types cannot be loaded.

        """
        from nena_edge_agent.ros.action_door import action_type  # noqa: PLC0415 - loads rclpy

        if settings.by_action_only and action_type(settings.navigation) is None:
            message = (
                "nav2_msgs cannot be loaded: source the robot's ROS installation with Nav2 before the start, "
                "or drive by topics (ros.navigation = topics)"
            )
            raise StartError(message)

    def new_door(self, settings: RosSettings) -> list[ActionDoor]:
        """Give what is to enter a new node: nothing where goals are given by topic alone."""
        from nena_edge_agent.ros.action_door import ActionDoor, ActionListeners, action_type  # noqa: PLC0415

        types = None
        if settings.navigation is not Navigation.TOPICS:
            types = action_type(settings.navigation)
        listeners = ActionListeners(self._on_result, self._take_feedback)
        self._door = None if types is None else ActionDoor(settings, types, listeners)
        return [self._door] if self._door else []

    def look(self) -> bool:
        """See whether a server takes goals; the next goal goes to it then."""
        self._tracker.by_action = self._door is not None and self._door.ready
        return self._tracker.by_action

    def on_other_statuses(self, entries: list[GoalEntry]) -> None:
        """Take the statuses of the action that only others give goals to."""
        self._apply(self._tracker.on_other_statuses(entries, self._clock.monotonic()))

    async def send(self, goal: MapGoal, goal_id: str) -> None:
        """Send a goal and take the server's answer."""
        log.info("goal sent", generation=goal.generation, goal=goal_id, x=goal.pose.x, y=goal.pose.y)
        accepted = (
            await self._door.send(goal_id, (goal.pose, *goal.ahead)) if self._door is not None else None
        )
        self._apply(self._tracker.on_goal_answer(goal_id, self._clock.monotonic(), accepted=accepted))

    def ask_result(self, goal_id: str) -> None:
        """Have the server tell the result of a goal when it ends."""
        if self._door is not None:
            self._door.ask_result(goal_id)

    def _on_result(self, result: GoalResult) -> None:
        reason = (result.error_code, result.error_message)
        now = self._clock.monotonic()
        self._apply(self._tracker.on_result(result.goal_id, result.status, reason, now))

    def _take_feedback(self, reading: FeedbackReading) -> None:
        self._tracker.on_places(reading.goal_id, reading.places_left)
        self._on_feedback(reading)
