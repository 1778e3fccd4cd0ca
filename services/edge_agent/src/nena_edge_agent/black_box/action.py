"""The action that requests a recording."""

from __future__ import annotations

from functools import partial

from nena_edge_agent.actions.plugin import BackgroundAction, Report, RunningAction, WorkFailedError
from nena_edge_agent.black_box.box import BlackBox
from nena_edge_agent.black_box.triggers import Reason
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.own_actions import FETCH_RECORDING
from nena_shared.vda5050.state import Load


class FetchRecording:
    """Writes a recording; the file's name is the action's result."""

    declaration = ActionDeclaration(
        FETCH_RECORDING,
        scopes=(ActionScope.INSTANT,),
        restartable=True,
        description="Writes the robot's last minutes to a file, and sends it to the status aggregator.",
    )

    def __init__(self, box: BlackBox) -> None:
        self._box = box

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Write the file in the background; it is sent after the action has ended."""
        return BackgroundAction(action.action_id, partial(self._work, action), report)

    async def _work(self, action: Action) -> ActionReport:
        try:
            name = await self._box.write(Reason.REQUEST)
        except OSError as error:
            message = f"the recording was not written: {error}; check the disk and upload.folder"
            raise WorkFailedError(message) from error
        return ActionReport(action.action_id, ActionStatus.FINISHED, name)
