"""Runs plug-ins for one robot; what one of them does wrong fails its action and nothing else."""

from __future__ import annotations

from collections.abc import Callable

from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.protocol.effects import CancelAction, PauseAction, ResumeAction, StartAction
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import get_logger
from nena_shared.vda5050.action import ActionStatus

log = get_logger(__name__)


class ActionRunner:
    """Begins, holds and gives up actions, as the core asks."""

    def __init__(self, registry: ActionRegistry, report: Report) -> None:
        self._registry = registry
        self._report = report
        self._running: dict[str, RunningAction] = {}

    def start(self, effect: StartAction) -> None:
        """Begin an action."""
        action = effect.action
        plugin = self._registry.plugin(action.action_type)
        if plugin is None:
            self._fail(action.action_id, f"nothing does '{action.action_type}' on this robot any more")
            return
        ended = False

        def report(report: ActionReport) -> None:
            nonlocal ended
            if report.status.ended:
                ended = True
                self._running.pop(action.action_id, None)
            self._report(report)

        def begin() -> None:
            running = plugin.start(action, effect.loads, report)
            if not ended:
                self._running[action.action_id] = running

        self._guarded(action.action_id, begin)

    def pause(self, effect: PauseAction) -> None:
        """Hold an action."""
        if running := self._running.get(effect.action_id):
            self._guarded(effect.action_id, running.pause)

    def resume(self, effect: ResumeAction) -> None:
        """Let a held action go on."""
        if running := self._running.get(effect.action_id):
            self._guarded(effect.action_id, running.resume)

    def cancel(self, effect: CancelAction) -> None:
        """Give up an action; one that nobody runs has failed already."""
        if running := self._running.get(effect.action_id):
            self._guarded(effect.action_id, running.cancel)
        else:
            self._fail(effect.action_id, "the action was not running")

    def close(self) -> None:
        """Give up all that runs, without a report: the agent ends, and the journal knows what ran."""
        running, self._running = self._running, {}
        self._report = _nobody
        for action_id, each in running.items():
            self._guarded(action_id, each.cancel)

    def _guarded(self, action_id: str, step: Callable[[], None]) -> None:
        try:
            step()
        except Exception as error:
            log.exception("an action plug-in failed", action=action_id)
            self._running.pop(action_id, None)
            self._fail(action_id, f"the plug-in failed: {error}")

    def _fail(self, action_id: str, reason: str) -> None:
        self._report(ActionReport(action_id, ActionStatus.FAILED, reason))


def _nobody(_: ActionReport) -> None:
    """Take no more reports."""
