"""An action whose work is a coroutine: it runs beside the robot's task, and can only be given up."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine

from nena_edge_agent.actions.plugin import Report
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import get_logger
from nena_shared.vda5050.action import ActionStatus

log = get_logger(__name__)


Work = Callable[[], Coroutine[None, None, ActionReport]]


class WorkFailedError(Exception):
    """The work of an action was not done; the text says why. ``report``, if given, tells of it."""

    def __init__(self, message: str, report: ActionReport | None = None) -> None:
        super().__init__(message)
        self.report = report


class BackgroundAction:
    """Runs ``work``, which gives the report of its end or raises :class:`WorkFailedError`."""

    def __init__(self, action_id: str, work: Work, report: Report) -> None:
        self._action_id = action_id
        self._report = report
        report(ActionReport(action_id, ActionStatus.RUNNING))
        self._task = asyncio.create_task(self._run(work), name=f"action {action_id}")
        self._task.add_done_callback(self._over)

    @property
    def ended(self) -> bool:
        """Whether nothing more comes of it."""
        return self._task.done()

    def pause(self) -> None:
        """Do nothing: such actions declare that they cannot be held."""

    def resume(self) -> None:
        """Do nothing."""

    def cancel(self) -> None:
        """Give up; the work may put things right before it ends."""
        self._task.cancel()

    async def _run(self, work: Work) -> None:
        try:
            self._report(await work())
        except WorkFailedError as error:
            if error.report:
                self._report(error.report)
            else:
                self._fail(str(error))
        except Exception as error:
            log.exception("an action failed", action=self._action_id)
            self._fail(f"the plug-in failed: {error}")

    def _over(self, task: asyncio.Task[None]) -> None:
        if task.cancelled():
            self._fail("cancelled")

    def _fail(self, reason: str) -> None:
        self._report(ActionReport(self._action_id, ActionStatus.FAILED, reason))
