"""The contract of action plug-ins, as checks that run on any of them.

Each check begins actions of the plug-in as the agent would, and looks at what it does. What a check finds
wrong would not hurt the agent (see ``run``), but fail actions of orders.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from functools import partial
from itertools import count
from math import ceil
from typing import Any, Final

from pydantic import JsonValue, ValidationError

from nena_edge_agent.actions.plugin import ActionPlugin, ActionTimeouts, RunningAction
from nena_edge_agent.actions.run import flaw_of
from nena_edge_agent.factsheet import make_factsheet
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.declaration import PREDEFINED, ActionDeclaration, LoadChange, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.action import Action, ActionParameter, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.versions import CODECS, RULES

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
    timeouts: ActionTimeouts = field(default_factory=ActionTimeouts)
    seconds: float = 10.0
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def declaration(self) -> ActionDeclaration:
        """What the plug-in declares."""
        return self.plugin.declaration

    def action(self) -> Action:
        """Build another action."""
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
        """Wait for a condition; return whether it has come true."""
        loop = asyncio.get_running_loop()
        limit = loop.time() + seconds
        while not condition():
            if loop.time() > limit:
                return False
            await asyncio.sleep(LOOK_EVERY)
        return True

    async def runs(self) -> None:
        """Wait until it has begun."""
        seconds = self.subject.timeouts.begin
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
        seconds = self.subject.timeouts.obey
        if not await self.until(lambda: self.end, seconds):
            text = f"no end was reported within {seconds:g} s of cancel"
            raise BrokenError(text, "report FAILED when the action has given up")
        self.sound()

    def sound(self) -> None:
        """Check all reports so far."""
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
    """Return a value that the parameter takes."""
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


SETTLE: Final = 0.2
"""Seconds in which nothing may come any more."""


class Verdict(StrEnum):
    """What a check has found."""

    OK = "ok"
    BROKEN = "BROKEN"
    NOT_SEEN = "not seen"


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: what it looked at, what it found, and what to do about it."""

    check: str
    verdict: Verdict
    text: str
    remedy: str = ""


async def declares(subject: Subject) -> str:
    """Declaration: it can stand in the factsheet, and is nobody else's."""
    declaration = subject.declaration
    keys = [each.key for each in declaration.parameters]
    if not declaration.action_type or declaration.action_type in PREDEFINED:
        text = f"the action type '{declaration.action_type}' is empty, or one of the agent's own"
        raise BrokenError(text, "call it something else")
    if not declaration.scopes or not declaration.blocking_types:
        text = "it has no scopes or no blocking types, so that no order can ever ask for it"
        raise BrokenError(text, "declare where it may stand")
    if len(set(keys)) < len(keys):
        text = f"two parameters have the same key: {', '.join(keys)}"
        raise BrokenError(text, "give each parameter a key of its own")
    await asyncio.to_thread(_encoded, declaration)  # which takes its time, and is not the plug-in's fault
    scopes, parameters = ", ".join(declaration.scopes), ", ".join(keys) or "none"
    return f"'{declaration.action_type}' for {scopes}; parameters: {parameters}"


async def judges(subject: Subject) -> str:
    """Check beforehand: it says what is wrong, and never fails."""
    action, scope = subject.action(), subject.declaration.scopes[0]
    strange = action.model_copy(update={"action_parameters": ()})
    check = subject.declaration.check or (lambda _: None)
    for each in (action, strange):
        found = called("check", partial(check, each))
        if not isinstance(found, str | None):
            text = f"the check gave {found!r}"
            raise BrokenError(text, "give None, or a sentence that says what is wrong")
    problem = subject.declaration.problem(action, scope)
    if problem:
        text = f"{problem}; give what it needs by --parameters"
        raise NotSeenError(text)
    return "takes the parameters of the trial"


async def ends(subject: Subject) -> str:
    """Start to end: it says that it has begun, and once how it has ended."""
    async with _trial(subject) as trial:
        await trial.runs()
        if subject.declaration.open_ended:
            text = "it is open-ended: it lasts until its edge ends"
            raise NotSeenError(text)
        if not await trial.until(lambda: trial.end, subject.seconds):
            raise _unended(subject)
        await asyncio.sleep(SETTLE)
        trial.sound()
        end = trial.end
        if end and end.status is ActionStatus.FAILED and not end.result:
            text = "it failed and did not say why"
            raise BrokenError(text, "give the reason as the result")
        return f"{end.status}: {end.result or 'no result'}" if end else ""


async def holds(subject: Subject) -> str:
    """Pause and resume: it holds, nothing ends meanwhile, and it goes on."""
    if not subject.declaration.pause_allowed:
        text = "declares that it cannot be paused"
        raise NotSeenError(text)
    async with _trial(subject) as trial:
        await trial.runs_still()
        trial.ask("pause")
        await _answered(trial, ActionStatus.PAUSED, "pause")
        await asyncio.sleep(SETTLE)
        if trial.statuses[-1] is not ActionStatus.PAUSED:
            text = f"in the pause {trial.statuses[-1]} was reported"
            raise BrokenError(text, "do nothing while it is held")
        trial.ask("resume")
        await _answered(trial, ActionStatus.RUNNING, "resume")
        return "holds, and goes on"


async def gives_up(subject: Subject) -> str:
    """Cancel: it ends with a reason, also when it is held, also when it is asked twice."""
    async with _trial(subject) as trial:
        await trial.runs_still()
        if not subject.declaration.cancel_allowed:
            trial.ask("cancel")
            text = "declares that it cannot be cancelled; at the agent's end it can"
            raise NotSeenError(text)
        await trial.gives_up()
        if trial.end and trial.end.status is ActionStatus.FAILED and not trial.end.result:
            text = "it was cancelled and did not say so"
            raise BrokenError(text, "give the reason as the result: cancelled")
    if subject.declaration.pause_allowed:
        async with _trial(subject) as trial:
            await trial.runs_still()
            trial.ask("pause")
            await _answered(trial, ActionStatus.PAUSED, "pause")
            await trial.gives_up()
    return f"gives up: {trial.end.result if trial.end else ''}"


async def is_silent_afterwards(subject: Subject) -> str:
    """Behind the end: whatever comes then does nothing."""
    async with _trial(subject) as trial:
        await trial.runs()
        trial.ask("cancel")
        if not await trial.until(lambda: trial.end, max(subject.seconds, subject.timeouts.obey)):
            text = "the action did not end"
            raise NotSeenError(text)
        before = len(trial.reports)
        for name in (*METHODS, "cancel"):
            trial.ask(name)
        await asyncio.sleep(SETTLE)
        if len(trial.reports) > before:
            text = f"{', '.join(trial.statuses[before:])} was reported behind the end"
            raise BrokenError(text, "report nothing behind the end")
        return "does nothing"


async def keeps_apart(subject: Subject) -> str:
    """Two at a time: each tells of itself."""
    async with _trial(subject) as one, _trial(subject) as other:
        await one.runs()
        await other.runs()
        for each in (one, other):
            each.ask("cancel")
        await other.until(lambda: one.end and other.end, subject.timeouts.obey)
        one.sound()
        other.sound()
        return "each tells of itself"


Check = Callable[[Subject], Awaitable[str]]

CHECKS: Final[tuple[Check, ...]] = (
    declares,
    judges,
    ends,
    holds,
    gives_up,
    is_silent_afterwards,
    keeps_apart,
)


async def examine(subject: Subject, found: list[Finding], checks: Sequence[Check] = CHECKS) -> None:
    """Run ``checks``, one after the other; each puts its finding into ``found``."""
    tasks, threads = set(asyncio.all_tasks()), set(threading.enumerate())
    for check in checks:
        found.append(await _judged(check, subject))  # noqa: PERF401 - seen one by one, should the next hang
    found.append(await _cleaned_up(tasks, threads))


async def _judged(check: Check, subject: Subject) -> Finding:
    name = _name(check)
    try:
        return Finding(name, Verdict.OK, await check(subject))
    except NotSeenError as error:
        return Finding(name, Verdict.NOT_SEEN, str(error))
    except BrokenError as error:
        return Finding(name, Verdict.BROKEN, str(error), error.remedy)
    except Exception as error:  # noqa: BLE001 - a plug-in may do anything, and the checks go on
        text = f"{type(error).__name__}: {error}"
        return Finding(name, Verdict.BROKEN, text, "see the plug-in's declaration")


async def _cleaned_up(tasks: set[asyncio.Task[Any]], threads: set[threading.Thread]) -> Finding:
    """Look for what ended actions have left behind."""
    name, left = "Nothing left", ""
    for _ in range(100):
        more = [each.get_name() for each in asyncio.all_tasks() - tasks]
        more += [each.name for each in set(threading.enumerate()) - threads if "asyncio" not in each.name]
        left = ", ".join(more)
        if not left:
            return Finding(name, Verdict.OK, "no task and no thread is left behind")
        await asyncio.sleep(LOOK_EVERY)
    text = f"left behind by actions that have ended: {left}"
    return Finding(name, Verdict.BROKEN, text, "end tasks and threads with the action that began them")


@asynccontextmanager
async def _trial(subject: Subject) -> AsyncIterator[Trial]:
    """Begin an action; whatever comes of it, it is given up in the end, as the agent does when it ends."""
    trial = Trial(subject)
    trial.start()
    try:
        yield trial
    finally:
        if not trial.end:
            trial.ask("cancel")
            allowed = subject.declaration.cancel_allowed
            await trial.until(lambda: trial.end, subject.timeouts.obey if allowed else SETTLE)


async def _answered(trial: Trial, status: ActionStatus, what: str) -> None:
    seconds = trial.subject.timeouts.obey
    done = await trial.until(lambda: trial.statuses[-1] is status or trial.end, seconds)
    trial.sound()
    if trial.end:
        text = "the action ended before it could be seen"
        raise NotSeenError(text)
    if not done:
        text = f"{status} was not reported within {seconds:g} s of {what}"
        raise BrokenError(text, f"report {status} when told to {what}, or declare pause_allowed=False")


def _unended(subject: Subject) -> Exception:
    """Judge an action that goes on and on."""
    declaration = subject.declaration
    if declaration.cancel_allowed or declaration.timeout is not None:
        limit = "" if declaration.timeout is None else f", and fails after {declaration.timeout:g} s"
        return NotSeenError(f"it does not end by itself within {subject.seconds:g} s{limit}")
    text = f"it does not end within {subject.seconds:g} s, cannot be cancelled and has no timeout"
    return BrokenError(text, "end, or declare cancel_allowed or a timeout; --patience waits for longer")


def _encoded(declaration: ActionDeclaration) -> None:
    header = {
        "header_id": 0,
        "timestamp": datetime.now(UTC),
        "manufacturer": "NeNa",
        "serial_number": "check",
    }
    try:
        for version, codec in CODECS.items():
            actions = {declaration.action_type: declaration}
            capabilities = Capabilities("map", actions=actions, rules=RULES[version])
            codec.encode(make_factsheet({**header, "version": version}, EdgeAgentSettings(), capabilities))
    except (MalformedMessageError, ValidationError, AttributeError, TypeError) as error:
        text = f"it cannot be told in the factsheet: {error}"
        raise BrokenError(text, "declare texts, types and scopes of VDA 5050") from error


def _name(check: Check) -> str:
    """Return what stands before the colon of its docstring."""
    return (check.__doc__ or "").split(":", 1)[0]
