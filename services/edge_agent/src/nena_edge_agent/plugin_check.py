"""For tests of action plug-ins, with pytest for example: check a plug-in without a robot.

``await check_plugin(plugin, {"height": 1.5})`` starts actions as the agent would. A plug-in that breaks its
contract cannot harm the agent (see ``actions.run``), but its actions fail. :class:`DryRos` and
:class:`DryDrive` are for the plug-in's context.
"""

from __future__ import annotations

import asyncio
import sys
import threading
import traceback
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from itertools import count
from math import ceil
from pathlib import Path
from typing import Any, Final

from pydantic import JsonValue, ValidationError

from nena_edge_agent.actions.messages import (
    FieldError,
    Record,
    action_type,
    conform_value,
    message_type,
    read_fields,
    service_type,
)
from nena_edge_agent.actions.plugin import (
    ActionPlugin,
    ActionTimeouts,
    Fields,
    Publisher,
    RosActionClient,
    RosError,
    ServiceClient,
    TopicQos,
)
from nena_edge_agent.actions.ros_port import installed
from nena_edge_agent.actions.run import report_problem
from nena_edge_agent.driver.port import Pose
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

POLL_INTERVAL: Final = 0.01
"""Seconds between two checks of a condition."""
SETTLE: Final = 0.2
"""Time to wait for unwanted reports, seconds."""
METHODS: Final = ("pause", "resume", "cancel")


class ContractError(AssertionError):
    """The plug-in breaks its contract; the text says how, and what to do."""


def require(kept: object, problem: str, remedy: str) -> None:
    """Raise ContractError unless ``kept``."""
    if not kept:
        raise ContractError(f"{problem}: {remedy}")


async def check_plugin(
    plugin: ActionPlugin,
    parameters: Mapping[str, JsonValue] | None = None,
    *,
    seconds: float = 10.0,
    timeouts: ActionTimeouts | None = None,
) -> None:
    """Check a plug-in: its declaration, and actions with ``parameters``, which should end in ``seconds``.

    A required parameter that is missing gets a valid value. Pausing and cancelling are checked only if the
    declaration allows them and the actions take long enough.

    Raises:
        ContractError: the plug-in breaks its contract.
    """
    trials = PluginTrials(plugin, parameters or {}, seconds, timeouts or ActionTimeouts())
    watchdog = Watchdog()
    tasks, threads = set(asyncio.all_tasks()), set(threading.enumerate())

    def leaks() -> list[str]:
        names = [task.get_name() for task in asyncio.all_tasks() - tasks]
        left = set(threading.enumerate()) - threads
        return names + [thread.name for thread in left if "asyncio" not in thread.name]  # its pool stays

    try:
        await trials.check_declaration()
        trials.check_parameters()
        await trials.check_end()
        await trials.check_pause()
        await trials.check_cancel()
        await trials.check_two()
    finally:
        watchdog.stop()
    problem = f"it blocks the whole agent at {watchdog.blocked}"
    require(not watchdog.blocked, problem, "await, or run blocking code in a thread: asyncio.to_thread")
    await _wait_until(lambda: not leaks(), 1.0)
    problem = f"left running by actions that have ended: {', '.join(leaks())}"
    require(not leaks(), problem, "end tasks and threads together with their action")


class PluginTrials:
    """The checks of one plug-in; each starts actions of its own."""

    def __init__(
        self,
        plugin: ActionPlugin,
        parameters: Mapping[str, JsonValue],
        seconds: float,
        timeouts: ActionTimeouts,
    ) -> None:
        self._plugin = plugin
        self._declaration = plugin.declaration
        self._parameters = parameters
        self._seconds = seconds
        self._timeouts = timeouts
        self._numbers = count(1)

    async def check_declaration(self) -> None:
        """Check that the declaration fits the factsheet, and that its action type is not reserved."""
        declaration = self._declaration
        keys = [parameter.key for parameter in declaration.parameters]
        reserved = not declaration.action_type or declaration.action_type in PREDEFINED
        problem = f"the action type '{declaration.action_type}' is empty or reserved by the agent"
        require(not reserved, problem, "choose another name")
        problem = "it has no scopes or no blocking types, so no order can contain it"
        require(
            declaration.scopes and declaration.blocking_types, problem, "declare scopes and blocking types"
        )
        problem = f"two parameters have the same key: {', '.join(keys)}"
        require(len(set(keys)) == len(keys), problem, "use a different key for each parameter")
        await asyncio.to_thread(_encode_factsheet, declaration)  # slow, and not the plug-in's fault

    def check_parameters(self) -> None:
        """Check that ``check`` never raises, says what is wrong, and accepts the parameters given here."""
        action = self.make_action()
        check = self._declaration.check or (lambda _: None)
        for tried in (action.model_copy(update={"action_parameters": ()}), action):
            answer = _call_plugin("check", partial(check, tried))
            problem = f"check returned {answer!r}"
            require(
                isinstance(answer, str | None), problem, "return None, or a sentence that says what is wrong"
            )
        refusal = self._declaration.problem(action, self._declaration.scopes[0])
        require(refusal is None, str(refusal), "pass valid parameters")

    async def check_end(self) -> None:
        """Check that an action reports its start, and its end once, unless it runs until its edge ends."""
        async with self._start_action() as trial:
            if self._declaration.open_ended:
                return
            ended = await _wait_until(lambda: trial.end, self._seconds)
            limited = self._declaration.cancel_allowed or self._declaration.timeout is not None
            problem = f"it does not end within {self._seconds:g} s, cannot be cancelled and has no timeout"
            require(
                ended or limited,
                problem,
                "end it, declare cancel_allowed or a timeout, or allow more seconds",
            )
            if ended:
                await trial.check_silence()

    async def check_pause(self) -> None:
        """Check that an action pauses, stays paused, and continues."""
        if not self._declaration.pause_allowed:
            return
        async with self._start_action() as trial:
            if await trial.answers("pause", ActionStatus.PAUSED):
                await asyncio.sleep(SETTLE)
                problem = f"it reported {trial.statuses[-1]} while paused"
                require(trial.statuses[-1] is ActionStatus.PAUSED, problem, "report nothing while paused")
                await trial.answers("resume", ActionStatus.RUNNING)

    async def check_cancel(self) -> None:
        """Check that a cancelled action ends with a reason, also while paused, and is silent afterwards."""
        if not self._declaration.cancel_allowed:
            return
        async with self._start_action() as trial:
            await trial.cancel()
            await trial.check_silence()
        if self._declaration.pause_allowed:
            async with self._start_action() as trial:
                await trial.answers("pause", ActionStatus.PAUSED)
                await trial.cancel()

    async def check_two(self) -> None:
        """Check that two actions at a time report for themselves."""
        async with self._start_action() as first, self._start_action() as second:
            for trial in (first, second):
                trial.call("cancel")
            await _wait_until(lambda: first.end and second.end, self._timeouts.obey)
            first.check_reports()
            second.check_reports()

    def make_action(self) -> Action:
        """Create an action with a new ID."""
        declaration = self._declaration
        samples = {
            parameter.key: sample_value(parameter)
            for parameter in declaration.parameters
            if parameter.required
        }
        instant = declaration.scopes == (ActionScope.INSTANT,)
        return Action(
            action_type=declaration.action_type,
            action_id=f"check-{next(self._numbers)}",
            # Instant actions are always NONE since 3.0 (7.4).
            blocking_type=BlockingType.NONE if instant else declaration.blocking_types[-1],
            action_parameters=tuple(
                ActionParameter(key=key, value=value)
                for key, value in {**samples, **self._parameters}.items()
            ),
        )

    @asynccontextmanager
    async def _start_action(self) -> AsyncIterator[_Trial]:
        """Start an action; cancel it afterwards if it still runs, as the agent does when it exits."""
        loads = (Load(load_id="check"),) if self._declaration.load is LoadChange.GIVE else ()
        trial = _Trial(self._plugin, self.make_action(), loads, self._timeouts)
        try:
            await trial.wait_started()
            yield trial
        finally:
            if not trial.end:
                trial.call("cancel")
                seconds = self._timeouts.obey if self._declaration.cancel_allowed else SETTLE
                await _wait_until(lambda: trial.end, seconds)


class _Trial:
    """A running action of the plug-in and its reports."""

    def __init__(
        self, plugin: ActionPlugin, action: Action, loads: tuple[Load, ...], timeouts: ActionTimeouts
    ) -> None:
        self._action_id = action.action_id
        self._timeouts = timeouts
        self.reports: list[Any] = []
        self._running: Any = _call_plugin("start", lambda: plugin.start(action, loads, self.reports.append))
        missing = [name for name in METHODS if not callable(getattr(self._running, name, None))]
        problem = f"start returned {self._running!r}, which has no {', '.join(missing)}"
        require(not missing, problem, "return an object with pause, resume and cancel")

    def call(self, method: str) -> None:
        """Call pause, resume or cancel."""
        _call_plugin(method, getattr(self._running, method))

    @property
    def statuses(self) -> list[ActionStatus]:
        """Return the statuses reported so far."""
        return [report.status for report in self.reports if isinstance(report, ActionReport)]

    @property
    def end(self) -> ActionReport | None:
        """Return the final report, None before the end."""
        reports = (report for report in self.reports if isinstance(report, ActionReport))
        return next((report for report in reports if report.status.ended), None)

    async def wait_started(self) -> None:
        """Wait for the first report."""
        seconds = self._timeouts.begin
        started = await _wait_until(lambda: self.reports, seconds)
        problem = f"no report within {seconds:g} s of the start"
        require(started, problem, "report RUNNING as soon as the action has started")
        self.check_reports()

    async def answers(self, method: str, status: ActionStatus) -> bool:
        """Call a method and wait for the status that answers it; return False if the action ended before."""
        if not self.end:
            self.call(method)
        seconds = self._timeouts.obey
        answered = await _wait_until(lambda: self.statuses[-1] is status or self.end, seconds)
        self.check_reports()
        problem = f"{status} was not reported within {seconds:g} s of {method}"
        require(answered, problem, f"report {status} on {method}, or declare pause_allowed=False")
        return self.end is None

    async def cancel(self) -> None:
        """Cancel the action and wait for its end."""
        self.call("cancel")
        seconds = self._timeouts.obey
        ended = await _wait_until(lambda: self.end, seconds)
        problem = f"the action did not end within {seconds:g} s of cancel"
        require(ended, problem, "report FAILED when the action has stopped")
        self.check_reports()

    async def check_silence(self) -> None:
        """Check that an action that has ended reports nothing more, whatever is called."""
        for method in (*METHODS, "cancel"):
            self.call(method)
        await asyncio.sleep(SETTLE)
        self.check_reports()

    def check_reports(self) -> None:
        """Check all reports so far."""
        for report in self.reports:
            flaw = report_problem(report, self._action_id)
            require(flaw is None, f"it reported {flaw}", "report ActionReport(action.action_id, status, ...)")
        ends = [status for status in self.statuses if status.ended]
        problem = f"it reported {', '.join(self.statuses)}"
        require(
            not ends or (len(ends) == 1 and self.statuses[-1].ended),
            problem,
            "report the end once, and nothing after it",
        )
        unexplained = self.end and self.end.status is ActionStatus.FAILED and not self.end.result
        problem = "it failed or was cancelled without a reason"
        require(not unexplained, problem, "report the reason as the result, for example: cancelled")


async def _wait_until(condition: Callable[[], object], seconds: float) -> bool:
    """Wait for a condition; return False on timeout."""
    loop = asyncio.get_running_loop()
    limit = loop.time() + seconds
    while not condition():
        if loop.time() > limit:
            return False
        await asyncio.sleep(POLL_INTERVAL)
    return True


def _call_plugin(name: str, step: Callable[[], Any]) -> Any:  # noqa: ANN401 - any object that the plug-in returns
    """Call ``step`` of the plug-in; raises ContractError if the step raised an exception."""
    try:
        return step()
    except Exception as error:
        remedy = f"catch exceptions in {name}; report FAILED with the reason"
        raise ContractError(f"{name} raised {type(error).__name__}: {error}: {remedy}") from error


def sample_value(parameter: Parameter) -> JsonValue:
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


def _encode_factsheet(declaration: ActionDeclaration) -> None:
    header = {
        "header_id": 0,
        "timestamp": datetime.now(UTC),
        "manufacturer": "NeNa",
        "serial_number": "check",
    }
    try:
        # A plug-in does not know which version its robot speaks.
        for version, codec in CODECS.items():
            actions = {declaration.action_type: declaration}
            capabilities = Capabilities("map", actions=actions, rules=RULES[version])
            codec.encode(make_factsheet({**header, "version": version}, EdgeAgentSettings(), capabilities))
    except (MalformedMessageError, ValidationError, AttributeError, TypeError) as error:
        raise ContractError(
            f"it does not fit the factsheet: {error}: use the texts, types and scopes of VDA 5050"
        ) from error


SAMPLE_INTERVAL: Final = 0.05
"""Interval between two samples, seconds."""
BLOCKED_SAMPLES: Final = 4
"""Samples without progress until the loop counts as blocked. Samples, not seconds: on a busy machine, samples
are late as well."""
WAITING: Final = frozenset({"select", "poll", "epoll", "_run_once"})
"""Functions in which an event loop waits."""


# The agent cannot guard against a plug-in that blocks its only event loop (0020): a test must find it.
class Watchdog:
    """Watches the running event loop; ``blocked`` is the line of code that has blocked it, or empty."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        self._rounds = 0
        self._stop = threading.Event()
        self.blocked = ""
        self._count_rounds()
        threading.Thread(target=self._watch_loop, name="watchdog", daemon=True).start()

    def stop(self) -> None:
        """Stop watching."""
        self._stop.set()

    def _count_rounds(self) -> None:
        self._rounds += 1
        if not self._stop.is_set():
            self._loop.call_later(SAMPLE_INTERVAL / 2, self._count_rounds)

    def _watch_loop(self) -> None:
        rounds, samples = 0, 0
        while not self._stop.wait(SAMPLE_INTERVAL) and not self.blocked:
            frame = sys._current_frames().get(self._thread)  # noqa: SLF001 - the documented way to inspect another thread
            idle = frame is None or frame.f_code.co_name in WAITING
            samples, rounds = (samples + 1 if self._rounds == rounds and not idle else 0), self._rounds
            if samples == BLOCKED_SAMPLES:
                self.blocked = _place_of(traceback.extract_stack(frame))


def _place_of(stack: Sequence[traceback.FrameSummary]) -> str:
    """Return the innermost line outside the event loop and the standard library."""
    library = str(Path(threading.__file__).parent)
    own = [
        frame
        for frame in stack
        if not frame.filename.startswith(library) or "site-packages" in frame.filename
    ]
    last = (own or stack)[-1]
    return f"{last.filename}:{last.lineno} in {last.name}"


DRIVE_TIME = 0.2
"""Duration of every simulated drive, seconds."""


class DryDrive:
    """Simulated drives, which arrive after ``DRIVE_TIME``."""

    def __init__(self) -> None:
        self.pose: Pose | None = Pose(0.0, 0.0, 0.0, "map")

    async def drive(
        self,
        pose: Pose,
        *,
        deviation_xy: float,  # noqa: ARG002 - the port's names
        deviation_theta: float | None = None,  # noqa: ARG002
        maximum_speed: float | None = None,  # noqa: ARG002
    ) -> None:
        """Wait, then arrive."""
        await asyncio.sleep(DRIVE_TIME)
        self.pose = pose

    async def initialize_position(self, pose: Pose) -> None:
        """Accept the position."""
        self.pose = pose


class DryRos:
    """Simulated ROS: accepts valid messages and publishes none; services report success, goals succeed.

    Each method raises RosError if the type is not installed.
    """

    def publisher(self, topic: str, type_name: str) -> Publisher:
        """Return a publisher with one subscriber."""
        return _DryPublisher(topic, installed(message_type, type_name))

    def subscribe(
        self,
        topic: str,  # noqa: ARG002 - the port's names
        type_name: str,
        handle: Callable[[Fields], None],  # noqa: ARG002
        *,
        qos: TopicQos = TopicQos.RELIABLE,  # noqa: ARG002
    ) -> None:
        """Check the type; no messages arrive."""
        installed(message_type, type_name)

    def client(self, service: str, type_name: str) -> ServiceClient:
        """Return a client whose service always responds."""
        return _DryClient(service, *installed(service_type, type_name))

    def action(self, name: str, type_name: str) -> RosActionClient:
        """Return a client whose goals all succeed."""
        return _DryAction(name, *installed(action_type, type_name))


class _DryAction:
    def __init__(self, name: str, goal: Record, kind: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        self._name = name
        self._goal = goal
        self._kind = kind

    async def run(self, fields: Mapping[str, JsonValue]) -> Fields:
        _check_fields(fields, self._goal, self._name)
        await asyncio.sleep(DRIVE_TIME)
        return read_fields(self._kind.Result())


class _DryPublisher:
    listeners = 1

    def __init__(self, topic: str, shape: Record) -> None:
        self._topic = topic
        self._shape = shape

    def publish(self, fields: Mapping[str, JsonValue]) -> None:
        _check_fields(fields, self._shape, self._topic)


class _DryClient:
    def __init__(self, service: str, request: Record, response: Record) -> None:
        self._service = service
        self._request = request
        self._response = response

    async def call(self, fields: Mapping[str, JsonValue], *, seconds: float) -> Fields:  # noqa: ARG002
        _check_fields(fields, self._request, self._service)
        response = read_fields(self._response.make())
        return response | {"success": True} if "success" in response else response


def _check_fields(fields: Mapping[str, JsonValue], shape: Record, path: str) -> None:
    try:
        conform_value(dict(fields), shape, path)
    except FieldError as error:
        raise RosError(str(error)) from error
