"""The action logReport (VDA 5050 3.0 section 6.2.3)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from nena_edge_agent.actions.plugin import BackgroundAction, Report, RunningAction, WorkFailedError
from nena_edge_agent.extensions.black_box.settings import LogReportSettings
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import recent_lines
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

Send = Callable[[str, Callable[[Path], object]], Coroutine[None, None, None]]
"""Sends a file, given its name and what writes it."""


class LogReport:
    """Writes the newest lines of the log (VDA 5050 3.0 section 6.2.3).

    The file's name is the action's result.
    """

    declaration = ActionDeclaration(
        "logReport",
        scopes=(ActionScope.INSTANT,),
        parameters=(Parameter("reason", ValueDataType.STRING, description="for people"),),
        restartable=True,
        description="Writes the agent's recent log lines to a file and returns its name.",
    )

    def __init__(self, settings: LogReportSettings, send: Send | None = None) -> None:
        """Write into the folder of ``settings``; ``send`` also sends the report to the server."""
        self._settings = settings
        self._send = send

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Write the file in the background."""
        return BackgroundAction(action.action_id, partial(self._write_report, action), report)

    async def _write_report(self, action: Action) -> ActionReport:
        reason = str(action.parameter("reason"))
        name = f"{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}.log"
        text = "\n".join([f"log report: {reason}", *recent_lines()]) + "\n"
        try:
            await asyncio.to_thread(self._write_file, name, text)
            if self._send:
                await self._send(name, partial(Path.write_text, data=text, encoding="utf-8"))
        except (OSError, RuntimeError) as error:
            raise WorkFailedError(f"the log report was not written: {error}") from error
        return ActionReport(action.action_id, ActionStatus.FINISHED, name)

    def _write_file(self, name: str, text: str) -> None:
        folder = self._settings.folder.expanduser()
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text, encoding="utf-8")
        for old in sorted(folder.glob("*.log"))[: -self._settings.keep]:
            old.unlink(missing_ok=True)
