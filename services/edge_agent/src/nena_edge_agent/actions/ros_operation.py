"""An action that publishes a message, calls a service, and awaits a message: those of them that there are."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass

from pydantic import JsonValue

from nena_edge_agent.actions.answer import Answer
from nena_edge_agent.actions.background import BackgroundAction, WorkFailedError
from nena_edge_agent.actions.call import Call
from nena_edge_agent.actions.command import Command
from nena_edge_agent.actions.message_shape import FieldError
from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.actions.ports import RosError
from nena_edge_agent.actions.values import ActionValues
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import get_logger
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.state import Load

log = get_logger(__name__)

Values = Mapping[str, JsonValue]


@dataclass(frozen=True, slots=True)
class Steps:
    """What is done, in this order. ``lasting``: it then lasts until it is given up."""

    command: Command | None = None
    call: Call | None = None
    answer: Answer | None = None
    lasting: bool = False

    def problem(self, values: Values) -> str | None:
        """Say which value of an action does not fit; None if all do."""
        try:
            for step in (self.command, self.call, self.answer):
                if step:
                    step.check(values)
        except FieldError as error:
            return str(error)
        return None


class RosOperation:
    """Does its steps, and has finished when the last one has."""

    def __init__(
        self,
        declaration: ActionDeclaration,
        steps: Steps,
        values: ActionValues,
        *,
        charging: bool | None,
    ) -> None:
        self.declaration = declaration
        self._steps = steps
        self._values = values
        self._charging = charging

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Begin."""
        values = self._values.of(action)
        return _Running(action.action_id, self._steps, values, report, charging=self._charging)


class _Running(BackgroundAction):
    """One run of the steps, which messages can hold where the command has such."""

    def __init__(
        self, action_id: str, steps: Steps, values: Values, report: Report, *, charging: bool | None
    ) -> None:
        self._steps = steps
        self._values = values
        self._charging = charging
        self._commanded = False
        self._free = asyncio.Event()
        self._free.set()
        super().__init__(action_id, self._work, report)

    def pause(self) -> None:
        """Send what holds it; what was not sent yet is held back."""
        if self._steps.command and not self.ended:
            self._free.clear()
            if self._commanded:
                self._steps.command.pause(self._values)
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))

    def resume(self) -> None:
        """Send what has it go on."""
        if self._steps.command and not self.ended:
            self._free.set()
            if self._commanded:
                self._steps.command.resume(self._values)
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING))

    async def _work(self) -> ActionReport:
        try:
            if self._steps.command:
                await self._steps.command.heard()
            result = await self._do()
        except (RosError, FieldError) as error:
            raise WorkFailedError(str(error)) from error
        return ActionReport(self._action_id, ActionStatus.FINISHED, result, charging=self._charging)

    async def _do(self) -> str | None:
        """Do the steps; the answer is listened to from before the first, so that none is missed."""
        steps, result = self._steps, None
        answered = steps.answer.expect(self._values, self._progress) if steps.answer else None
        try:
            if steps.command:
                await self._command(steps.command)
            if steps.call:
                result = await steps.call.do(self._values)
            if steps.answer and answered:
                self._progress(steps.answer.words)
                result = await answered
            if steps.lasting:
                await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            self._take_back()
            raise
        finally:
            if answered:
                answered.cancel()
        return result

    async def _command(self, command: Command) -> None:
        await self._free.wait()
        command.begin(self._values)
        self._commanded = True

    def _progress(self, text: str) -> None:
        if self._free.is_set():
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING, text))

    def _take_back(self) -> None:
        if self._steps.command and self._commanded:
            try:
                self._steps.command.cancel(self._values)
            except (RosError, FieldError) as error:
                log.warning("an action could not be taken back", reason=str(error))
