"""Actions that use ROS, on a robot that has none: refused with the reason, or rehearsed."""

from __future__ import annotations

from dataclasses import replace

from nena_edge_agent.actions.countdown import Countdown
from nena_edge_agent.actions.ended import ENDED
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.state import Load

NO_ROS = 'it uses ROS, which this robot does not have; actions.without_ros = "rehearse" would rehearse it'


class Unavailable:
    """Knows the action, so that its refusal can say why."""

    def __init__(self, declaration: ActionDeclaration, reason: str = NO_ROS) -> None:
        self.declaration = replace(declaration, unavailable=reason)

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Fail: one of before a change of the settings."""
        report(ActionReport(action.action_id, ActionStatus.FAILED, self.declaration.unavailable))
        return ENDED


class Rehearsed:
    """Takes ``seconds`` in place of what it would do."""

    def __init__(self, declaration: ActionDeclaration, seconds: float, *, charging: bool | None) -> None:
        self.declaration = replace(
            declaration, pause_allowed=True, cancel_allowed=True, restartable=True, timeout=None
        )
        self._seconds = seconds
        self._charging = charging

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin; one that lasts does so until it is given up."""

        def done() -> None:
            report(
                ActionReport(action.action_id, ActionStatus.FINISHED, "rehearsed", charging=self._charging)
            )

        lasting = self.declaration.open_ended
        countdown = Countdown(action.action_id, float("inf") if lasting else self._seconds, report, done)
        countdown.start()
        return countdown
