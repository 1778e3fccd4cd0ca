"""wait: stand, or drive on, for a time that the order gives."""

from __future__ import annotations

from nena_edge_agent.actions.countdown import Countdown
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

LONGEST = 86_400.0
"""Seconds."""


class Wait:
    """Ends after the ``duration`` of its action, in s."""

    declaration = ActionDeclaration(
        "wait",
        scopes=(ActionScope.NODE, ActionScope.EDGE, ActionScope.INSTANT),
        parameters=(Parameter("duration", ValueDataType.NUMBER, description="s, 0 to 86400"),),
        pause_allowed=True,
        cancel_allowed=True,
        restartable=True,
        description="Waits.",
    )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin to wait."""
        value = action.parameter("duration")
        seconds = float(value) if isinstance(value, int | float) else 0.0

        def done() -> None:
            report(ActionReport(action.action_id, ActionStatus.FINISHED))

        countdown = Countdown(action.action_id, min(max(seconds, 0.0), LONGEST), report, done)
        countdown.start()
        return countdown
