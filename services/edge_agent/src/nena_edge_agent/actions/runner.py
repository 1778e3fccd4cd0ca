"""Runs plug-ins for one robot; what one of them does wrong fails its action and nothing else."""

from __future__ import annotations

from nena_edge_agent.actions.plugin import Report
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.run import Patience, Run
from nena_edge_agent.protocol.events import ActionReport, CancelAction, PauseAction, ResumeAction, StartAction
from nena_shared.vda5050.action import ActionStatus


class ActionRunner:
    """Begins, holds and gives up actions, as the core asks."""

    def __init__(self, registry: ActionRegistry, report: Report, patience: Patience | None = None) -> None:
        self._registry = registry
        self._report = report
        self._patience = patience or Patience()
        self._runs: dict[str, Run] = {}

    def start(self, effect: StartAction) -> None:
        """Begin an action; an earlier run under its id, of which nothing more is wanted, is given up."""
        action = effect.action
        plugin = self._registry.plugin(action.action_type)
        if plugin is None:
            self._fail(action.action_id, f"nothing does '{action.action_type}' on this robot any more")
            return
        if before := self._runs.pop(action.action_id, None):
            before.abandon()
        run = Run(action, plugin, self._told, self._patience)
        self._runs[action.action_id] = run
        run.start(effect.loads)

    def pause(self, effect: PauseAction) -> None:
        """Hold an action."""
        if run := self._runs.get(effect.action_id):
            run.pause()

    def resume(self, effect: ResumeAction) -> None:
        """Let a held action go on."""
        if run := self._runs.get(effect.action_id):
            run.resume()

    def cancel(self, effect: CancelAction) -> None:
        """Give up an action; one that nobody runs has failed already."""
        if run := self._runs.get(effect.action_id):
            run.cancel()
        else:
            self._fail(effect.action_id, "the action was not running")

    def close(self) -> None:
        """Give up all that runs, without a report: the agent ends, and the journal knows what ran."""
        runs, self._runs = self._runs, {}
        for run in runs.values():
            run.abandon()

    def _told(self, report: ActionReport) -> None:
        if report.status.ended:
            self._runs.pop(report.action_id, None)
        self._report(report)

    def _fail(self, action_id: str, reason: str) -> None:
        self._report(ActionReport(action_id, ActionStatus.FAILED, reason))
