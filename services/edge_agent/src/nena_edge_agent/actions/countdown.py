"""A time that runs down, and can be held."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from nena_edge_agent.actions.plugin import Report
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus


class Countdown:
    """An action that is done after ``seconds``; calls ``done`` then, which reports the end."""

    def __init__(self, action_id: str, seconds: float, report: Report, done: Callable[[], None]) -> None:
        self._action_id = action_id
        self._left = seconds
        self._report = report
        self._done = done
        self._timer: asyncio.TimerHandle | None = None
        self._ended = False

    def start(self) -> None:
        """Let the time run."""
        self._timer = asyncio.get_running_loop().call_later(self._left, self._over)
        self._report(ActionReport(self._action_id, ActionStatus.RUNNING))

    def pause(self) -> None:
        """Hold the time."""
        if self._timer is not None:
            self._left = max(0.0, self._timer.when() - asyncio.get_running_loop().time())
            self._stop()
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))

    def resume(self) -> None:
        """Let the time run on."""
        if self._timer is None and not self._ended:
            self.start()

    def cancel(self) -> None:
        """End before the time is over."""
        if not self._ended:
            self._ended = True
            self._stop()
            self._report(ActionReport(self._action_id, ActionStatus.FAILED, "cancelled"))

    def _over(self) -> None:
        self._ended, self._timer = True, None
        self._done()

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
