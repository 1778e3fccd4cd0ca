"""startPause and stopPause (section 6.2.3), and what else holds the robot."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.declaration import START_PAUSE
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.travel import Travel
from nena_shared.vda5050.action import Action, ActionStatus


class Pause:
    """Stops driving and holds the actions that can be held, and lets both go on.

    Fleet control, the pause button, an emergency stop, a field violation, an operator who intervenes and an
    error that hinders hold the robot in the same way, and each for itself: it goes on when the last is over.
    """

    def __init__(self, parts: RobotParts, flow: ActionFlow, travel: Travel) -> None:
        self._parts = parts
        self._flow = flow
        self._travel = travel

    def start(self, action: Action) -> None:
        """Pause; finished when the robot stands. In a pause that is no change."""
        self._parts.instants.change(action.action_id, ActionStatus.RUNNING)
        self._parts.paused = True

    def stop(self, action: Action) -> None:
        """End the pause; one that has not come to a stand yet is taken back. The button cannot be undone."""
        parts = self._parts
        parts.end_instants(START_PAUSE, ActionStatus.FAILED, "taken back by stopPause")
        parts.paused = False
        if parts.senses.pause_button:
            text = "the pause button is pressed"
            parts.instants.change(action.action_id, ActionStatus.FAILED, text)
        else:
            parts.instants.change(action.action_id, ActionStatus.FINISHED)

    def apply(self) -> None:
        """Hold the robot, or let it go on, if that has changed."""
        parts = self._parts
        if parts.held == parts.holding:
            return
        parts.holding = parts.held
        if parts.holding:
            self._flow.pause()
            self._travel.halt()
        else:
            self._flow.resume()
            self._flow.schedule()

    def advance(self) -> None:
        """Finish when the robot stands."""
        if self._parts.paused and not self._parts.goal.moving:
            self._parts.end_instants(START_PAUSE, ActionStatus.FINISHED)
