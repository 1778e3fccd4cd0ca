"""Actions of a plug-in under trial: begun, held and given up as the agent would, and watched."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from math import ceil
from typing import Any, Final

from pydantic import JsonValue

from nena_edge_agent.actions.flaw import flaw_of
from nena_edge_agent.actions.plugin import ActionPlugin, RunningAction
from nena_edge_agent.actions.run import Patience
from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionParameter, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load

LOOK_EVERY: Final = 0.01
"""Seconds between two looks at a condition."""
METHODS: Final = ("pause", "resume", "cancel")


class BrokenError(Exception):
    """The plug-in does not keep the contract."""

    def __init__(self, text: str, remedy: str) -> None:
        super().__init__(text)
        self.remedy = remedy


class NotSeenError(Exception):
    """The plug-in gave no occasion to see it; the text says why."""


@dataclass(slots=True)
class Subject:
    """A plug-in under trial, with the ``parameters`` of its actions and seconds until they should end."""

    plugin: ActionPlugin
    parameters: Mapping[str, JsonValue] = field(default_factory=dict)
    patience: Patience = field(default_factory=Patience)
    seconds: float = 10.0
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def declaration(self) -> ActionDeclaration:
        """What the plug-in declares."""
        return self.plugin.declaration

    def action(self) -> Action:
        """Make another action."""
        given = {each.key: sample(each) for each in self.declaration.parameters if each.required}
        parameters = (
            ActionParameter(key=key, value=value) for key, value in (given | {**self.parameters}).items()
        )
        return Action(
            action_type=self.declaration.action_type,
            action_id=f"check-{next(self.numbers)}",
            blocking_type=BlockingType.NONE
            if self.declaration.scopes == (ActionScope.INSTANT,)
            else self.declaration.blocking_types[-1],
            action_parameters=tuple(parameters),
        )


class Trial:
    """One action that the plug-in was given, and what it has reported."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.action = subject.action()
        self.reports: list[Any] = []
        self.running: RunningAction | None = None

    def start(self) -> None:
        """Have it begin."""
        takes = self.subject.declaration.load
        loads = (Load(load_id="check"),) if takes is LoadChange.GIVE else ()
        self.running = called(
            "start", lambda: self.subject.plugin.start(self.action, loads, self.reports.append)
        )
        missing = [name for name in METHODS if not callable(getattr(self.running, name, None))]
        if missing:
            text = f"start gave {self.running!r}, which has no {', '.join(missing)}"
            raise BrokenError(text, "give an object with all of pause, resume and cancel")

    def ask(self, name: str) -> None:
        """Have it hold, go on or give up."""
        called(name, getattr(self.running, name))

    @property
    def statuses(self) -> list[ActionStatus]:
        """What it has said so far."""
        return [each.status for each in self.reports if isinstance(each, ActionReport)]

    @property
    def end(self) -> ActionReport | None:
        """The report of its end."""
        return next(
            (each for each in self.reports if isinstance(each, ActionReport) and each.status.ended), None
        )

    async def until(self, condition: Callable[[], object], seconds: float) -> bool:
        """Wait for a condition; tells whether it has come true."""
        loop = asyncio.get_running_loop()
        limit = loop.time() + seconds
        while not condition():
            if loop.time() > limit:
                return False
            await asyncio.sleep(LOOK_EVERY)
        return True

    async def runs(self) -> None:
        """Wait until it has begun."""
        seconds = self.subject.patience.begin
        if not await self.until(lambda: self.reports, seconds):
            text = f"nothing was reported within {seconds:g} s of the start"
            raise BrokenError(text, "report RUNNING as soon as the action has begun")
        self.sound()

    async def runs_still(self) -> None:
        """Wait until it has begun; one that has ended by then shows nothing."""
        await self.runs()
        if self.end:
            text = "the action ended before it could be seen"
            raise NotSeenError(text)

    async def gives_up(self) -> None:
        """Cancel it, and wait for its end."""
        self.ask("cancel")
        seconds = self.subject.patience.obey
        if not await self.until(lambda: self.end, seconds):
            text = f"no end was reported within {seconds:g} s of cancel"
            raise BrokenError(text, "report FAILED when the action has given up")
        self.sound()

    def sound(self) -> None:
        """Look at all reports so far."""
        for report in self.reports:
            if flaw := flaw_of(report, self.action.action_id):
                text = f"reported was {flaw}"
                raise BrokenError(text, "report ActionReport(action.action_id, status, ...)")
        ends = [each for each in self.statuses if each.ended]
        if len(ends) > 1 or (ends and not self.statuses[-1].ended):
            text = f"reported was {', '.join(self.statuses)}"
            raise BrokenError(text, "report the end once, and nothing behind it")


def called(name: str, step: Callable[[], Any]) -> Any:  # noqa: ANN401 - what the plug-in gives
    """Call ``step`` of the plug-in.

    Raises:
        BrokenError: it has raised.

    """
    try:
        return step()
    except Exception as error:
        text = f"{name} raised {type(error).__name__}: {error}"
        raise BrokenError(text, f"let {name} raise nothing; report FAILED with the reason") from error


def sample(parameter: Parameter) -> JsonValue:
    """Give a value that the parameter takes."""
    if parameter.choices:
        return parameter.choices[0]
    most = 1.0 if parameter.maximum is None else min(1.0, parameter.maximum)
    number = most if parameter.minimum is None else parameter.minimum
    samples: dict[ValueDataType, JsonValue] = {
        ValueDataType.BOOL: True,
        ValueDataType.NUMBER: float(number),
        ValueDataType.INTEGER: ceil(number),
        ValueDataType.OBJECT: {},
        ValueDataType.ARRAY: ["check"],
        ValueDataType.STRING: "check",
    }
    return samples[parameter.data_type]
