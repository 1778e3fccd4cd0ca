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
            scopes=settings.scopes,
            blocking_types=settings.blocking_types,
            pause_allowed=settings.interruptible,
            cancel_allowed=settings.interruptible,
            restartable=True,
            description=f"Takes {settings.seconds:g} s.",
        )

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
        """Begin, unless the load forbids it."""
        problem = self._load_problem(loads)

        def done() -> None:
            report(
                ActionReport(
                    action.action_id,
                    ActionStatus.FINISHED,
                    loads=self._loads_after(action),
                    charging=self._settings.charging,
                )
            )

        countdown = Countdown(action.action_id, self._settings.seconds, report, done)
        if problem:
            report(ActionReport(action.action_id, ActionStatus.FAILED, problem))
        else:
            countdown.start()
        return countdown

    def _load_problem(self, loads: tuple[Load, ...]) -> str | None:
        if self._settings.load == "take" and loads:
            return "the robot is loaded already"
        if self._settings.load == "give" and not loads:
            return "the robot carries nothing"
        return None

    def _loads_after(self, action: Action) -> tuple[Load, ...] | None:
        match self._settings.load:
            case "take":
                return (Load(load_id=_text(action, "loadId"), load_type=_text(action, "loadType")),)
            case "give":
                return ()
            case _:
                return None


def _text(action: Action, key: str) -> str | None:
    value = action.parameter(key)
    return None if value is None else str(value)
