"""Run actions in their plug-ins: supervise each run, and check its reports."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from math import inf
from typing import Any, Final

from nena_edge_agent.actions.plugin import ActionPlugin, ActionTimeouts, Report, RunningAction
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.protocol.events import ActionReport, CancelAction, PauseAction, ResumeAction, StartAction
from nena_shared.log import get_logger
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.state import Load, Map
from nena_shared.vda5050.zone_set import ZoneSet

REPORTED: Final = frozenset(
    {
        ActionStatus.INITIALIZING,
        ActionStatus.RUNNING,
        ActionStatus.PAUSED,
        ActionStatus.FINISHED,
        ActionStatus.FAILED,
    }
)
"""Statuses that a plug-in may report; the core reports the others."""


def _all_of(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, tuple) and all(isinstance(item, kind) for item in value)


def _is_one(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kind)


# 0020: a wrong type could not be encoded, and the robot would send no state any more.
_FIELD_CHECKS: Final[Mapping[str, tuple[Callable[[Any], bool], str]]] = {
    "result": (_is_one(str), "a text"),
    "loads": (_all_of(Load), "a tuple of Load"),
    "charging": (_is_one(bool), "True or False"),
    "maps": (_all_of(Map), "a tuple of Map"),
    "zone_set": (_is_one(ZoneSet), "a ZoneSet"),
    "error": (_is_one(ErrorEntry), "an ErrorEntry"),
}
"""Check of each optional field, and the name of its type."""


def report_problem(report: object, action_id: str) -> str | None:
    """Return what is wrong with a report of the action ``action_id``; continues "the plug-in reported"."""
    if not isinstance(report, ActionReport):
        return f"{_short_repr(report)}, which is not an ActionReport"
    if report.action_id != action_id:
        return f"on another action: {report.action_id!r}"
    if report.status not in REPORTED:
        return f"the status {report.status!r}, which plug-ins must not report"
    for name, (sound, what) in _FIELD_CHECKS.items():
        value = getattr(report, name)
        if value is not None and not sound(value):
            return f"{name} {_short_repr(value)}, which is not {what}"
    return None


def _short_repr(value: object) -> str:
    return repr(value)[:100]


log = get_logger(__name__)

PROGRESS_INTERVAL = 0.5
"""Minimum interval between two progress reports, seconds; of more frequent ones, only the newest is sent."""
MAXIMUM_RESULT = 1000
"""Maximum length of a result, characters, because every state contains it; longer ones are truncated."""


class Run:
    """One running action. An exception of its plug-in only fails this action, with a reason.

    Reports may arrive from any thread. Valid ones are passed to ``on_report`` in the event loop's thread,
    and none after the end of the action.
    """

    def __init__(
        self, action: Action, plugin: ActionPlugin, on_report: Report, timeouts: ActionTimeouts
    ) -> None:
        self._action = action
        self._plugin = plugin
        self._on_report = on_report
        self._timeouts = timeouts
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        self._log = log.bind(action=action.action_id, action_type=action.action_type)
        self._running: RunningAction | None = None
        self._status = ActionStatus.INITIALIZING
        self._progress = _Progress(self._loop, self._send_report)
        self._last_result = ""
        self._answer: asyncio.TimerHandle | None = None
        self._limit = _Stopwatch(self._loop, plugin.declaration.timeout, self._over_time)
        self.ended = False

    def start(self, loads: tuple[Load, ...]) -> None:
        """Start the action."""
        text = f"the plug-in did not report its start within {self._timeouts.begin:g} s"
        self._expect_report(self._timeouts.begin, lambda: self._fail_action(text))
        self._isolate_errors(lambda: self._begin_action(loads))

    def pause(self) -> None:
        """Pause the action; if the plug-in does not, the action continues and its result says so."""
        if self._running is None:
            return
        text = f"the plug-in did not pause within {self._timeouts.obey:g} s"
        self._expect_report(
            self._timeouts.obey, lambda: self._send_report(self._report_of(self._status, text))
        )
        self._isolate_errors(self._running.pause)

    def resume(self) -> None:
        """Resume the action."""
        if self._running is not None:
            self._isolate_errors(self._running.resume)

    def cancel(self) -> None:
        """Cancel the action; if the plug-in does not in time, the action fails anyway."""
        if self._running is None:
            self._fail_action("cancelled")
            return
        text = f"the plug-in did not cancel within {self._timeouts.obey:g} s; check the robot"
        self._expect_report(self._timeouts.obey, lambda: self._fail_action(text))
        self._isolate_errors(self._running.cancel)

    def abandon(self) -> None:
        """Cancel the action without a report."""
        if not self.ended:
            self._end_action()
            self._cancel_quietly()

    def take_report(self, report: ActionReport) -> None:
        """Handle a report of the plug-in, from any thread."""
        if threading.get_ident() == self._thread:
            self._accept_report(report)
            return
        try:
            self._loop.call_soon_threadsafe(self._accept_report, report)
        except RuntimeError:
            self._log.debug("the event loop ended before the plug-in")

    def _begin_action(self, loads: tuple[Load, ...]) -> None:
        running = self._plugin.start(self._action, loads, self.take_report)
        if self.ended:  # start itself may have reported the end
            return
        self._running = running
        missing = [
            name for name in ("pause", "resume", "cancel") if not callable(getattr(running, name, None))
        ]
        if missing:
            self._running = None
            self._fail_action(f"start of the plug-in returned an object without {', '.join(missing)}")

    def _accept_report(self, report: ActionReport) -> None:
        if self.ended:
            self._log.warning("ignored a report after the end of an action", report=repr(report))
        elif flaw := report_problem(report, self._action.action_id):
            self._fail_action(f"the plug-in reported {flaw}")
        elif report.status is ActionStatus.FAILED:
            self._end_action()
            self._send_report(replace(report, result=report.result or "the plug-in reported no reason"))
        elif report.status.ended:
            self._end_action()
            self._send_report(report)
        else:
            self._continue_action(report)

    def _continue_action(self, report: ActionReport) -> None:
        previous, self._status = self._status, report.status
        self._last_result = report.result or self._last_result
        # Progress changes no status (VDA 5050, 6.6.9). Plug-ins may report it more often than states go out.
        if report.status is previous is ActionStatus.RUNNING:
            self._progress.update_report(report)
            return
        self._progress.drop_report()
        if previous is ActionStatus.INITIALIZING or report.status is ActionStatus.PAUSED:
            self._stop_waiting()
        # A pause may last as long as a person wants: it does not count.
        self._limit.switch(on=report.status is ActionStatus.RUNNING)
        self._send_report(report)

    def _over_time(self) -> None:
        last = f"; last progress: {self._last_result}" if self._last_result else ""
        self._fail_action(f"the action took longer than {self._plugin.declaration.timeout:g} s{last}")

    def _fail_action(self, reason: str) -> None:
        if not self.ended:
            self._end_action()
            self._send_report(self._report_of(ActionStatus.FAILED, reason))
            self._cancel_quietly()

    def _report_of(self, status: ActionStatus, text: str) -> ActionReport:
        self._log.warning("an action plug-in misbehaves", problem=text)
        return ActionReport(self._action.action_id, status, text)

    def _cancel_quietly(self) -> None:
        """Cancel the action at the plug-in; ignore a failure."""
        running, self._running = self._running, None
        if running is not None:
            try:
                running.cancel()
            except Exception:
                log.exception("an action plug-in failed to cancel", action=self._action.action_id)

    def _end_action(self) -> None:
        self.ended = True
        self._stop_waiting()
        self._progress.drop_report()
        self._limit.switch(on=False)

    def _send_report(self, report: ActionReport) -> None:
        if report.result is not None and len(report.result) > MAXIMUM_RESULT:
            report = replace(report, result=report.result[:MAXIMUM_RESULT])
        self._on_report(report)

    def _isolate_errors(self, step: Callable[[], None]) -> None:
        try:
            step()
        except Exception as error:
            log.exception("an action plug-in failed", action=self._action.action_id)
            self._fail_action(f"the plug-in failed: {str(error) or type(error).__name__}")

    def _expect_report(self, seconds: float, otherwise: Callable[[], None]) -> None:
        self._stop_waiting()
        self._answer = self._loop.call_later(seconds, otherwise)

    def _stop_waiting(self) -> None:
        if self._answer is not None:
            self._answer.cancel()
            self._answer = None


class _Progress:
    """Passes on the newest progress report, at most one per :data:`PROGRESS_INTERVAL`."""

    def __init__(self, loop: asyncio.AbstractEventLoop, send: Report) -> None:
        self._loop = loop
        self._send_report = send
        self._sent_at = -inf
        self._timer: asyncio.TimerHandle | None = None

    def update_report(self, report: ActionReport) -> None:
        """Send the report now, or replace the waiting one."""
        self.drop_report()
        due = self._sent_at + PROGRESS_INTERVAL
        if due <= self._loop.time():
            self._send_now(report)
        else:
            self._timer = self._loop.call_at(due, self._send_now, report)

    def drop_report(self) -> None:
        """Drop the waiting report."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _send_now(self, report: ActionReport) -> None:
        self.drop_report()
        self._sent_at = self._loop.time()
        self._send_report(report)


class _Stopwatch:
    """Calls ``over`` once it has run for ``seconds`` in total; None: never."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, seconds: float | None, over: Callable[[], None]
    ) -> None:
        self._loop = loop
        self._left = seconds
        self._over = over
        self._timer: asyncio.TimerHandle | None = None

    def switch(self, *, on: bool) -> None:
        """Start or stop; repeated calls have no effect."""
        if on and self._timer is None and self._left is not None:
            self._timer = self._loop.call_later(self._left, self._over)
        elif not on and self._timer is not None:
            self._left = max(0.0, self._timer.when() - self._loop.time())
            self._timer.cancel()
            self._timer = None


class ActionRunner:
    """Starts, pauses, resumes and cancels actions for the core."""

    def __init__(
        self, registry: ActionRegistry, report: Report, timeouts: ActionTimeouts | None = None
    ) -> None:
        self._registry = registry
        self._report = report
        self._timeouts = timeouts or ActionTimeouts()
        self._runs: dict[str, Run] = {}

    def start(self, effect: StartAction) -> None:
        """Start an action, and cancel an earlier one with the same ID."""
        action = effect.action
        plugin = self._registry.plugin(action.action_type)
        if plugin is None:
            self._fail_action(action.action_id, f"this robot no longer has the action '{action.action_type}'")
            return
        # A retry has the same ID (3.0, 6.2.3): a late report of the first try must not end the second (0020).
        if earlier_run := self._runs.pop(action.action_id, None):
            earlier_run.abandon()
        run = Run(action, plugin, self._on_report, self._timeouts)
        self._runs[action.action_id] = run
        run.start(effect.loads)

    def pause(self, effect: PauseAction) -> None:
        """Pause an action."""
        if run := self._runs.get(effect.action_id):
            run.pause()

    def resume(self, effect: ResumeAction) -> None:
        """Resume an action."""
        if run := self._runs.get(effect.action_id):
            run.resume()

    def cancel(self, effect: CancelAction) -> None:
        """Cancel an action; report FAILED if it does not run."""
        if run := self._runs.get(effect.action_id):
            run.cancel()
        else:
            self._fail_action(effect.action_id, "the action was not running")

    def close(self) -> None:
        """Cancel all actions without reports: the agent exits, and the journal has the running ones."""
        runs, self._runs = self._runs, {}
        for run in runs.values():
            run.abandon()

    def _on_report(self, report: ActionReport) -> None:
        if report.status.ended:
            self._runs.pop(report.action_id, None)
        self._report(report)

    def _fail_action(self, action_id: str, reason: str) -> None:
        self._report(ActionReport(action_id, ActionStatus.FAILED, reason))
