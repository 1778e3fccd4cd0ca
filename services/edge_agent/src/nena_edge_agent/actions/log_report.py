"""logReport: what the agent has logged of late, as a file (section 6.2.3)."""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from pydantic import Field

from nena_edge_agent.actions.background import BackgroundAction, WorkFailedError
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import recent_lines
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load


class LogReportSettings(SettingsGroup):
    """Log reports on request of fleet control."""

    folder: Path = Field(Path("~/.local/state/nena/log_reports"), description="Folder of the reports.")
    keep: int = Field(20, ge=1, le=1000, description="How many reports are kept; the oldest one goes.")


class LogReport:
    """Writes the newest lines of the log; the file's name is the action's result."""

    declaration = ActionDeclaration(
        "logReport",
        scopes=(ActionScope.INSTANT,),
        parameters=(Parameter("reason", ValueDataType.STRING, description="for people"),),
        restartable=True,
        description="Stores what the agent has logged of late, and names the file.",
    )

    def __init__(self, settings: LogReportSettings) -> None:
        self._settings = settings

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin to write."""
        return BackgroundAction(action.action_id, partial(self._work, action), report)

    async def _work(self, action: Action) -> ActionReport:
        reason = str(action.parameter("reason"))
        name = f"{datetime.now(UTC):%Y%m%dT%H%M%S.%fZ}.log"
        try:
            await asyncio.to_thread(self._write, name, [f"log report: {reason}", *recent_lines()])
        except (OSError, RuntimeError) as error:
            message = f"the log report was not written: {error}"
            raise WorkFailedError(message) from error
        return ActionReport(action.action_id, ActionStatus.FINISHED, name)

    def _write(self, name: str, lines: list[str]) -> None:
        folder = self._settings.folder.expanduser()
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
        for old in sorted(folder.glob("*.log"))[: -self._settings.keep]:
            old.unlink(missing_ok=True)
