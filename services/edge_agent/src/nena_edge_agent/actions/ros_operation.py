"""An action that publishes a message, calls a service, and awaits a message: those of them that there are."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

from pydantic import JsonValue

from nena_edge_agent.actions.answer import Answer
from nena_edge_agent.actions.background import BackgroundAction, Work, WorkFailedError
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
        work = partial(self._work, action.action_id, values, report)
        return _Steered(action.action_id, work, report, self._steps.command, values)

    async def _work(self, action_id: str, values: Values, report: Report) -> ActionReport:
        steps = self._steps
        try:
            if steps.command:
                await steps.command.heard()
            result = await self._do(action_id, values, report)
        except (RosError, FieldError) as error:
            raise WorkFailedError(str(error)) from error
        return ActionReport(action_id, ActionStatus.FINISHED, result, charging=self._charging)

    async def _do(self, action_id: str, values: Values, report: Report) -> str | None:
        """Do the steps; the answer is listened to from before the first, so that none is missed."""
        steps, result = self._steps, None

        def progress(text: str) -> None:
            report(ActionReport(action_id, ActionStatus.RUNNING, text))

        answered = steps.answer.expect(values, progress) if steps.answer else None
        try:
            if steps.command:
                steps.command.begin(values)
            if steps.call:
                result = await steps.call.do(values)
            if steps.answer and answered:
                progress(steps.answer.words)
                result = await answered
            if steps.lasting:
                await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            self._take_back(values)
            raise
        finally:
            if answered:
                answered.cancel()
        return result

    def _take_back(self, values: Values) -> None:
        if self._steps.command:
            try:
                self._steps.command.cancel(values)
            except (RosError, FieldError) as error:
                log.warning("an action could not be taken back", reason=str(error))


class _Steered(BackgroundAction):
    """Steps that can be held by messages."""

    def __init__(
        self, action_id: str, work: Work, report: Report, command: Command | None, values: Values
    ) -> None:
        super().__init__(action_id, work, report)
        self._command = command
        self._values = values

    def pause(self) -> None:
        """Send what holds it."""
        if self._command and not self.ended:
            self._command.pause(self._values)
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))

    def resume(self) -> None:
        """Send what has it go on."""
        if self._command and not self.ended:
            self._command.resume(self._values)
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING))
