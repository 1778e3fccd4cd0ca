"""An operation that takes a set time and may change the load (pick and drop by default)."""

from __future__ import annotations

from nena_edge_agent.actions.countdown import Countdown
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.state import Load


class TimedOperation:
    """Does nothing for the set time; then the load is taken or given."""

    def __init__(self, settings: OperationSettings) -> None:
        self._settings = settings
        self.declaration = ActionDeclaration(
            settings.action_type,
            parameters=tuple(each.declared for each in settings.parameters),
            scopes=settings.scopes,
            blocking_types=settings.blocking_types,
            pause_allowed=settings.interruptible,
            cancel_allowed=settings.interruptible,
            restartable=True,
            load=settings.load_change,
            description=settings.description or f"Takes {settings.seconds:g} s.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin."""

        def done() -> None:
            report(ActionReport(action.action_id, ActionStatus.FINISHED, charging=self._settings.charging))

        countdown = Countdown(action.action_id, self._settings.seconds, report, done)
        countdown.start()
        return countdown
