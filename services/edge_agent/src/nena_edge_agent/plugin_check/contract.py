"""Checks of the contract of action plug-ins.

Each check starts actions of the plug-in as the agent would, and observes them. A broken plug-in cannot harm
the agent (see ``run``), but its actions fail.
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
from nena_edge_agent.actions.run import report_problem
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
"""Seconds between two checks of a condition."""
METHODS: Final = ("pause", "resume", "cancel")


class BrokenError(Exception):
    """The plug-in violates the contract."""

    def __init__(self, text: str, remedy: str) -> None:
        super().__init__(text)
        self.remedy = remedy


class NotSeenError(Exception):
    """The plug-in cannot be checked here; the message explains why."""


@dataclass(slots=True)
class Subject:
    """The plug-in to check, the ``parameters`` of its actions, and the seconds in which they should end."""

    plugin: ActionPlugin
    parameters: Mapping[str, JsonValue] = field(default_factory=dict)
    timeouts: ActionTimeouts = field(default_factory=ActionTimeouts)
    seconds: float = 10.0
    numbers: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def declaration(self) -> ActionDeclaration:
        """Return the declaration of the plug-in."""
        return self.plugin.declaration

    def action(self) -> Action:
        """Create an action with a new ID."""
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
    """An action of the plug-in and its reports."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self.action = subject.action()
        self.reports: list[Any] = []
        self.running: RunningAction | None = None

    def start(self) -> None:
        """Start the action."""
        takes = self.subject.declaration.load
        loads = (Load(load_id="check"),) if takes is LoadChange.GIVE else ()
        self.running = called(
            "start", lambda: self.subject.plugin.start(self.action, loads, self.reports.append)
        )
        missing = [name for name in METHODS if not callable(getattr(self.running, name, None))]
        if missing:
            text = f"start returned {self.running!r}, which has no {', '.join(missing)}"
            raise BrokenError(text, "return an object with pause, resume and cancel")

    def ask(self, name: str) -> None:
        """Call pause, resume or cancel."""
        called(name, getattr(self.running, name))

    @property
    def statuses(self) -> list[ActionStatus]:
        """Return the statuses reported so far."""
        return [each.status for each in self.reports if isinstance(each, ActionReport)]

    @property
    def end(self) -> ActionReport | None:
        """Return the final report, None before the end."""
        return next(
            (each for each in self.reports if isinstance(each, ActionReport) and each.status.ended), None
        )

    async def until(self, condition: Callable[[], object], seconds: float) -> bool:
        """Wait for a condition; return False on timeout."""
        loop = asyncio.get_running_loop()
        limit = loop.time() + seconds
        while not condition():
            if loop.time() > limit:
                return False
            await asyncio.sleep(LOOK_EVERY)
        return True

    async def runs(self) -> None:
        """Wait for the first report."""
        seconds = self.subject.timeouts.begin
        if not await self.until(lambda: self.reports, seconds):
            text = f"no report within {seconds:g} s of the start"
            raise BrokenError(text, "report RUNNING as soon as the action has started")
        self.sound()

    async def runs_still(self) -> None:
        """Wait for the first report; raise NotSeenError if the action has already ended."""
        await self.runs()
        if self.end:
            text = "the action ended too early to check this"
            raise NotSeenError(text)

    async def gives_up(self) -> None:
        """Cancel the action and wait for its end."""
        self.ask("cancel")
        seconds = self.subject.timeouts.obey
        if not await self.until(lambda: self.end, seconds):
            text = f"the action did not end within {seconds:g} s of cancel"
            raise BrokenError(text, "report FAILED when the action has stopped")
        self.sound()

    def sound(self) -> None:
        """Check all reports so far; raise BrokenError for an invalid one."""
        for report in self.reports:
            if flaw := report_problem(report, self.action.action_id):
                text = f"it reported {flaw}"
                raise BrokenError(text, "report ActionReport(action.action_id, status, ...)")
        ends = [each for each in self.statuses if each.ended]
        if len(ends) > 1 or (ends and not self.statuses[-1].ended):
            text = f"it reported {', '.join(self.statuses)}"
            raise BrokenError(text, "report the end once, and nothing after it")


def called(name: str, step: Callable[[], Any]) -> Any:  # noqa: ANN401 - any object that the plug-in returns
    """Call ``step`` of the plug-in.

    Raises:
        BrokenError: the step raised an exception.

    """
    try:
        return step()
    except Exception as error:
        text = f"{name} raised {type(error).__name__}: {error}"
        raise BrokenError(text, f"catch exceptions in {name}; report FAILED with the reason") from error


def sample(parameter: Parameter) -> JsonValue:
    """Return a valid value of the parameter."""
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
"""Time to wait for unwanted reports, seconds."""


class Verdict(StrEnum):
    """Result of a check."""

    OK = "ok"
    BROKEN = "BROKEN"
    NOT_SEEN = "skipped"


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of a check, with what to do about it."""

    check: str
    verdict: Verdict
    text: str
    remedy: str = ""


async def declares(subject: Subject) -> str:
    """Declaration: it fits the factsheet, and the action type is not reserved."""
    declaration = subject.declaration
    keys = [each.key for each in declaration.parameters]
    if not declaration.action_type or declaration.action_type in PREDEFINED:
        text = f"the action type '{declaration.action_type}' is empty or reserved by the agent"
        raise BrokenError(text, "choose another name")
    if not declaration.scopes or not declaration.blocking_types:
        text = "it has no scopes or no blocking types, so no order can contain it"
        raise BrokenError(text, "declare scopes and blocking types")
    if len(set(keys)) < len(keys):
        text = f"two parameters have the same key: {', '.join(keys)}"
        raise BrokenError(text, "use a different key for each parameter")
    await asyncio.to_thread(_encoded, declaration)  # slow, and not the plug-in's fault
    scopes, parameters = ", ".join(declaration.scopes), ", ".join(keys) or "none"
    return f"'{declaration.action_type}' for {scopes}; parameters: {parameters}"


async def judges(subject: Subject) -> str:
    """Check of parameters: it returns what is wrong, and never raises."""
    action, scope = subject.action(), subject.declaration.scopes[0]
    strange = action.model_copy(update={"action_parameters": ()})
    check = subject.declaration.check or (lambda _: None)
    for each in (action, strange):
        found = called("check", partial(check, each))
        if not isinstance(found, str | None):
            text = f"check returned {found!r}"
            raise BrokenError(text, "return None, or a sentence that explains what is wrong")
    problem = subject.declaration.problem(action, scope)
    if problem:
        text = f"{problem}; pass valid ones with --parameters"
        raise NotSeenError(text)
    return "accepts the parameters"


async def ends(subject: Subject) -> str:
    """Start to end: it reports its start, and its end once."""
    async with _trial(subject) as trial:
        await trial.runs()
        if subject.declaration.open_ended:
            text = "open-ended: it runs until its edge ends"
            raise NotSeenError(text)
        if not await trial.until(lambda: trial.end, subject.seconds):
            raise _unended(subject)
        await asyncio.sleep(SETTLE)
        trial.sound()
        end = trial.end
        if end and end.status is ActionStatus.FAILED and not end.result:
            text = "it failed without a reason"
            raise BrokenError(text, "report the reason as the result")
        return f"{end.status}: {end.result or 'no result'}" if end else ""


async def holds(subject: Subject) -> str:
    """Pause and resume: it pauses, stays paused, and continues."""
    if not subject.declaration.pause_allowed:
        text = "the declaration does not allow pausing"
        raise NotSeenError(text)
    async with _trial(subject) as trial:
        await trial.runs_still()
        trial.ask("pause")
        await _answered(trial, ActionStatus.PAUSED, "pause")
        await asyncio.sleep(SETTLE)
        if trial.statuses[-1] is not ActionStatus.PAUSED:
            text = f"it reported {trial.statuses[-1]} while paused"
            raise BrokenError(text, "report nothing while paused")
        trial.ask("resume")
        await _answered(trial, ActionStatus.RUNNING, "resume")
        return "pauses and continues"


async def gives_up(subject: Subject) -> str:
    """Cancel: it ends with a reason, also while paused."""
    async with _trial(subject) as trial:
        await trial.runs_still()
        if not subject.declaration.cancel_allowed:
            trial.ask("cancel")
            text = "the declaration does not allow cancelling; the agent still cancels it when it exits"
            raise NotSeenError(text)
        await trial.gives_up()
        if trial.end and trial.end.status is ActionStatus.FAILED and not trial.end.result:
            text = "it was cancelled without a reason"
            raise BrokenError(text, "report the reason as the result, for example: cancelled")
    if subject.declaration.pause_allowed:
        async with _trial(subject) as trial:
            await trial.runs_still()
            trial.ask("pause")
            await _answered(trial, ActionStatus.PAUSED, "pause")
            await trial.gives_up()
    return f"ends: {trial.end.result if trial.end else ''}"


async def is_silent_afterwards(subject: Subject) -> str:
    """After the end: later calls have no effect."""
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
            text = f"{', '.join(trial.statuses[before:])} was reported after the end"
            raise BrokenError(text, "report nothing after the end")
        return "later calls have no effect"


async def keeps_apart(subject: Subject) -> str:
    """Two at a time: each action reports for itself."""
    async with _trial(subject) as one, _trial(subject) as other:
        await one.runs()
        await other.runs()
        for each in (one, other):
            each.ask("cancel")
        await other.until(lambda: one.end and other.end, subject.timeouts.obey)
        one.sound()
        other.sound()
        return "each action reports for itself"


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
    """Run ``checks`` one after the other and append each finding to ``found``."""
    tasks, threads = set(asyncio.all_tasks()), set(threading.enumerate())
    for check in checks:
        found.append(await _judged(check, subject))  # noqa: PERF401 - kept one by one, in case the next check hangs
    found.append(await _cleaned_up(tasks, threads))


async def _judged(check: Check, subject: Subject) -> Finding:
    name = _name(check)
    try:
        return Finding(name, Verdict.OK, await check(subject))
    except NotSeenError as error:
        return Finding(name, Verdict.NOT_SEEN, str(error))
    except BrokenError as error:
        return Finding(name, Verdict.BROKEN, str(error), error.remedy)
    except Exception as error:  # noqa: BLE001 - a plug-in may raise anything; the other checks continue
        text = f"{type(error).__name__}: {error}"
        return Finding(name, Verdict.BROKEN, text, "see the plug-in's declaration")


async def _cleaned_up(tasks: set[asyncio.Task[Any]], threads: set[threading.Thread]) -> Finding:
    """Find tasks and threads that outlive their actions."""
    name, left = "No leaks", ""
    for _ in range(100):
        more = [each.get_name() for each in asyncio.all_tasks() - tasks]
        more += [each.name for each in set(threading.enumerate()) - threads if "asyncio" not in each.name]
        left = ", ".join(more)
        if not left:
            return Finding(name, Verdict.OK, "no tasks or threads are left")
        await asyncio.sleep(LOOK_EVERY)
    text = f"left running by actions that have ended: {left}"
    return Finding(name, Verdict.BROKEN, text, "end tasks and threads together with their action")


@asynccontextmanager
async def _trial(subject: Subject) -> AsyncIterator[Trial]:
    """Start an action; cancel it afterwards if it is still running, as the agent does when it exits."""
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
        text = "the action ended too early to check this"
        raise NotSeenError(text)
    if not done:
        text = f"{status} was not reported within {seconds:g} s of {what}"
        raise BrokenError(text, f"report {status} on {what}, or declare pause_allowed=False")


def _unended(subject: Subject) -> Exception:
    """Return the exception for an action that does not end."""
    declaration = subject.declaration
    if declaration.cancel_allowed or declaration.timeout is not None:
        limit = "" if declaration.timeout is None else f", and fails after {declaration.timeout:g} s"
        return NotSeenError(f"it does not end within {subject.seconds:g} s{limit}")
    text = f"it does not end within {subject.seconds:g} s, cannot be cancelled and has no timeout"
    return BrokenError(
        text, "end the action, declare cancel_allowed or a timeout, or wait longer with --timeout"
    )


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
        text = f"it does not fit the factsheet: {error}"
        raise BrokenError(text, "use the texts, types and scopes of VDA 5050") from error


def _name(check: Check) -> str:
    """Return the text before the colon of its docstring."""
    return (check.__doc__ or "").split(":", 1)[0]
