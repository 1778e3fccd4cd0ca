"""startPause and stopPause (section 6.2.3)."""

from __future__ import annotations

from nena_edge_agent.protocol.action_flow import ActionFlow
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.predefined import START_PAUSE
from nena_edge_agent.protocol.travel import Travel
from nena_shared.vda5050.action import Action, ActionStatus


class Pause:
    """Stops driving and holds the actions that can be held, and lets both go on."""

    def __init__(self, parts: RobotParts, flow: ActionFlow, travel: Travel) -> None:
        self._parts = parts
        self._flow = flow
        self._travel = travel

    def start(self, action: Action) -> None:
        """Pause; finished when the robot stands. In a pause that is no change."""
        parts = self._parts
        parts.instants.change(action.action_id, ActionStatus.RUNNING)
        if not parts.paused:
            parts.paused = True
            self._flow.pause()
            self._travel.halt()

    def stop(self, action: Action) -> None:
        """End the pause; one that has not come to a stand yet is taken back."""
        parts = self._parts
        parts.end_instants(START_PAUSE, ActionStatus.FAILED, "taken back by stopPause")
        if parts.paused:
            parts.paused = False
            self._flow.resume()
            self._flow.schedule()
        parts.instants.change(action.action_id, ActionStatus.FINISHED)

    def advance(self) -> None:
        """Finish when the robot stands."""
        if self._parts.paused and not self._parts.goal.moving:
            self._parts.end_instants(START_PAUSE, ActionStatus.FINISHED)
