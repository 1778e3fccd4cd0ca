"""Configured operations that call the robot's services and publish on its topics.

From top to bottom: values of an order for messages, answers on topics, service calls, commands on topics, and
the plug-in that runs them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from pydantic import JsonValue

from nena_edge_agent.actions.messages import (
    ArrayShape,
    FieldError,
    Record,
    Shape,
    conform_value,
    fill_template,
    matches,
    shape_problems,
    template_problems,
    value_at,
)
from nena_edge_agent.actions.plugin import (
    BackgroundAction,
    Fields,
    Publisher,
    Report,
    RosError,
    RosPort,
    RunningAction,
    ServiceClient,
    TopicQos,
    WorkFailedError,
)
from nena_edge_agent.actions.settings import (
    AnswerSettings,
    CallSettings,
    CommandSettings,
    FieldValues,
    OperationBase,
    ParameterSettings,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ValueDataType
from nena_shared.vda5050.state import Load

ACTION_ID = "actionId"
# As for `pick` in the standard (6.2.3; 2.1: 6.8).
LOAD_PARAMETERS = tuple(
    ParameterSettings(key=key, required=False, description=f"the {what} of the load, for the state")
    for key, what in (("loadId", "id"), ("loadType", "type"))
)
"""Parameters added to an action that picks up a load."""


class ActionValues:
    """Values of an action that messages may contain, by name."""

    def __init__(self, settings: OperationBase) -> None:
        """Use the configured parameters, and those of the load if one is picked up."""
        own = {parameter.key for parameter in settings.parameters}
        more = LOAD_PARAMETERS if settings.load_change is LoadChange.TAKE else ()
        self._parameters = (*settings.parameters, *(each for each in more if each.key not in own))

    @property
    def declared(self) -> tuple[Parameter, ...]:
        """Return the parameters as declared to the core."""
        return tuple(parameter.declared for parameter in self._parameters)

    @property
    def names(self) -> frozenset[str]:
        """Return the names of all values."""
        return frozenset({ACTION_ID, *(parameter.key for parameter in self._parameters)})

    @property
    def types(self) -> Mapping[str, ValueDataType]:
        """Return the types of the parameters that are put into messages unchanged."""
        plain = {parameter.key: parameter.type for parameter in self._parameters if not parameter.values}
        return {**plain, ACTION_ID: ValueDataType.STRING}

    @property
    def mapped(self) -> Iterable[tuple[str, JsonValue]]:
        """Return each value that replaces a choice in messages, with its parameter's name."""
        return ((each.key, value) for each in self._parameters for value in each.values.values())

    def values_of(self, action: Action) -> dict[str, JsonValue]:
        """Return the values of ``action``."""
        values: dict[str, JsonValue] = {ACTION_ID: action.action_id}
        for parameter in self._parameters:
            value = action.parameter(parameter.key)
            values[parameter.key] = parameter.values.get(str(value), value)
        return values


class MessageTemplate:
    """A template for the fields of a message of one type, into which an action's values are inserted.

    Raises:
        ConfigurationError: no message can be built from them; the error names the setting under ``path``.
    """

    def __init__(
        self,
        fields: FieldValues,
        shape: Record,
        values: ActionValues,
        path: str,
        *,
        any_of: bool = False,
    ) -> None:
        """Check ``fields``; ``any_of``: an array instead of a value lists alternatives."""
        self._fields = fields
        self._shape = shape
        self._path = path
        self._any_of = any_of
        flaws = list(template_problems(fields, values.names, path))
        if not flaws:
            for variant in _alternatives_in(fields, shape) if any_of else [fields]:
                flaws += shape_problems(variant, shape, values.types, path)
                for name, value in values.mapped:
                    flaws += shape_problems(fill_template(variant, {name: value}), shape, {}, path)
        if flaws:
            raise ConfigurationError(list(dict.fromkeys(flaws)))

    def fill(self, values: Mapping[str, JsonValue]) -> FieldValues:
        """Return the fields with ``values`` inserted.

        Raises:
            FieldError: one of them does not fit its field.
        """
        fields = fill_template(self._fields, values)
        if not isinstance(fields, dict):
            raise FieldError(self._path)
        for variant in _alternatives_in(fields, self._shape) if self._any_of else [fields]:
            conform_value(variant, self._shape, self._path)
        return fields


def _alternatives_in(fields: JsonValue, shape: Shape) -> Iterator[JsonValue]:
    """Yield each value separately within its tables; of an array of alternatives, yield each item."""
    if isinstance(fields, dict) and isinstance(shape, Record):
        for key, value in fields.items():
            inner = shape.fields.get(key)
            yield from (
                {key: each} for each in ((value,) if inner is None else _alternatives_in(value, inner))
            )
    elif isinstance(fields, list) and not isinstance(shape, ArrayShape):
        for value in fields:
            yield from _alternatives_in(value, shape)
    else:
        yield fields


Progress = Callable[[str], None]


class Answer:
    """Subscribes to a topic and completes the waiting actions whose answer arrives.

    Raises:
        ConfigurationError: no message of the type can match.
        RosError: the type is not installed.
    """

    def __init__(
        self, settings: AnswerSettings, port: RosPort, shape: Record, values: ActionValues, path: str
    ) -> None:
        def template(fields: FieldValues | None, name: str) -> MessageTemplate | None:
            if fields is None:
                return None
            return MessageTemplate(fields, shape, values, f"{path}.{name}", any_of=True)

        self._settings = settings
        self._match = MessageTemplate(settings.match, shape, values, f"{path}.match", any_of=True)
        self._failed = template(settings.failed, "failed")
        self._in_progress = template(settings.progress, "progress")
        self.templates = (self._match, self._failed, self._in_progress)
        self._waiting: dict[int, Callable[[Fields], None]] = {}
        self._last: Fields | None = None
        port.subscribe(settings.topic, settings.type, self._on_message, qos=settings.qos)

    @property
    def words(self) -> str:
        """Return a description of what the action waits for."""
        return f"waits for {self._settings.topic}"

    def expect_answer(
        self, values: Mapping[str, JsonValue], progress: Progress
    ) -> asyncio.Future[str | None]:
        """Return a future that the answer completes: with the result, or a WorkFailedError.

        On a latched topic, the last earlier message is used too.
        """
        answered: asyncio.Future[str | None] = asyncio.get_running_loop().create_future()
        match = self._match.fill(values)
        failed = self._failed.fill(values) if self._failed else None
        in_progress = self._in_progress.fill(values) if self._in_progress else None

        def check_message(message: Fields) -> None:
            if answered.done():
                return
            text = self._result_text(message)
            # First: without fields in `match`, every message would end the action as a success.
            if failed is not None and matches(message, failed):
                reason = text or f"{self._settings.topic} reported failure"
                answered.set_exception(WorkFailedError(reason))
            elif matches(message, match):
                answered.set_result(text)
            elif in_progress is not None and matches(message, in_progress):
                progress(text or self.words)

        self._waiting[id(answered)] = check_message
        answered.add_done_callback(lambda _: self._waiting.pop(id(answered), None))
        # Only a latched topic tells a state; an earlier message of another answers an earlier action.
        if self._last is not None and self._settings.qos is TopicQos.LATCHED:
            check_message(self._last)
        return answered

    def _result_text(self, message: Fields) -> str | None:
        value = value_at(message, self._settings.result) if self._settings.result else None
        return None if value in (None, "") else str(value)

    def _on_message(self, message: Fields) -> None:
        self._last = message
        for check_message in list(self._waiting.values()):
            check_message(message)


SUCCESS = "success"
MESSAGE = "message"


class Call:
    """Calls a configured service with the values of an action, and checks the response.

    ``shapes`` are those of the request and the response.

    Raises:
        ConfigurationError: no request of the type can be built, or no response can match.
    """

    def __init__(
        self,
        settings: CallSettings,
        client: ServiceClient,
        shapes: tuple[Record, Record],
        values: ActionValues,
        path: str,
    ) -> None:
        request, response = shapes
        has = response.fields
        # The convention of std_srvs (Trigger, SetBool): `success`, and `message` with the reason.
        usual: FieldValues = {SUCCESS: True} if SUCCESS in has else {}
        expected = usual if settings.expect is None else settings.expect
        self._settings = settings
        self._client = client
        self._request = MessageTemplate(settings.fields, request, values, f"{path}.fields")
        self._expected = MessageTemplate(expected, response, values, f"{path}.expect", any_of=True)
        self.templates = (self._request, self._expected)
        self._result_path = (
            settings.result if settings.result is not None else MESSAGE if MESSAGE in has else ""
        )

    async def call_service(self, values: Mapping[str, JsonValue]) -> str | None:
        """Call the service and return the action's result.

        Raises:
            WorkFailedError: the response reported failure.
            RosError: there is no response.
            FieldError: a value does not fit its field.
        """
        response = await self._client.call(
            self._request.fill(values), seconds=self._settings.response_timeout
        )
        result = value_at(response, self._result_path) if self._result_path else None
        text = None if result in (None, "") else str(result)
        if not matches(response, self._expected.fill(values)):
            raise WorkFailedError(text or f"{self._settings.service} reported failure")
        return text


POLL_INTERVAL = 0.05
"""Interval between two checks for a subscriber, seconds."""


class Command:
    """Publishes a configured message with the values of an action.

    Raises:
        ConfigurationError: no message of the type can be built.
    """

    def __init__(
        self,
        settings: CommandSettings,
        publisher: Publisher,
        shape: Record,
        values: ActionValues,
        path: str,
    ) -> None:
        self._settings = settings
        self._publisher = publisher

        def template(fields: FieldValues | None, name: str) -> MessageTemplate | None:
            return None if fields is None else MessageTemplate(fields, shape, values, f"{path}.{name}")

        self.begin = template(settings.fields, "fields")
        self.pause = template(settings.on_pause, "on_pause")
        self.resume = template(settings.on_resume, "on_resume")
        self.cancel = template(settings.on_cancel, "on_cancel")
        self.templates = (self.begin, self.pause, self.resume, self.cancel)

    async def wait_for_subscriber(self) -> None:
        """Wait until a node subscribes; raises WorkFailedError if none does in time."""
        timeout = self._settings.listener_timeout
        for _ in range(int(timeout / POLL_INTERVAL)):
            if self._publisher.listeners:
                return
            await asyncio.sleep(POLL_INTERVAL)
        if timeout and not self._publisher.listeners:
            raise WorkFailedError(f"no node subscribes to {self._settings.topic}")

    def publish(self, template: MessageTemplate | None, values: Mapping[str, JsonValue]) -> None:
        """Publish one of its messages, if that is configured.

        Raises:
            RosError: there is no ROS session.
            FieldError: a value does not fit its field.
        """
        if template is not None:
            self._publisher.publish(template.fill(values))


log = get_logger(__name__)

Values = Mapping[str, JsonValue]


@dataclass(frozen=True, slots=True)
class Steps:
    """The steps of an action, in this order. ``lasting``: it then runs until it is cancelled."""

    command: Command | None = None
    call: Call | None = None
    answer: Answer | None = None
    lasting: bool = False

    def problem(self, values: Values) -> str | None:
        """Return which value of an action does not fit, None if all of them do."""
        try:
            for step in (self.command, self.call, self.answer):
                for template in filter(None, step.templates if step else ()):
                    template.fill(values)
        except FieldError as error:
            return str(error)
        return None


class RosOperation:
    """Runs its steps and finishes after the last one."""

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
        """Start the steps."""
        values = self._values.values_of(action)
        return _Running(action.action_id, self._steps, values, report, charging=self._charging)


class _Running(BackgroundAction):
    """One run of the steps; it can be paused if its command defines messages for this."""

    def __init__(
        self, action_id: str, steps: Steps, values: Values, report: Report, *, charging: bool | None
    ) -> None:
        self._steps = steps
        self._values = values
        self._charging = charging
        self._commanded = False
        self._resumed = asyncio.Event()
        self._resumed.set()
        super().__init__(action_id, self._run_operation, report)

    def pause(self) -> None:
        """Send the command's pause message; a command that was not sent yet waits for the resume."""
        if (command := self._steps.command) and not self.ended:
            self._resumed.clear()
            if self._commanded:
                command.publish(command.pause, self._values)
            self._report(ActionReport(self._action_id, ActionStatus.PAUSED))

    def resume(self) -> None:
        """Send the command's resume message."""
        if (command := self._steps.command) and not self.ended:
            self._resumed.set()
            if self._commanded:
                command.publish(command.resume, self._values)
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING))

    async def _run_operation(self) -> ActionReport:
        try:
            if self._steps.command:
                # A volatile message reaches only the subscribers that DDS has already matched.
                await self._steps.command.wait_for_subscriber()
            result = await self._run_steps()
        except (RosError, FieldError) as error:
            raise WorkFailedError(str(error)) from error
        return ActionReport(self._action_id, ActionStatus.FINISHED, result, charging=self._charging)

    async def _run_steps(self) -> str | None:
        """Run the steps; listen for the answer from before the first step, so that none is missed."""
        steps, result = self._steps, None
        answered = steps.answer.expect_answer(self._values, self._report_progress) if steps.answer else None
        try:
            if steps.command:
                await self._resumed.wait()
                steps.command.publish(steps.command.begin, self._values)
                self._commanded = True
            if steps.call:
                result = await steps.call.call_service(self._values)
            if steps.answer and answered:
                self._report_progress(steps.answer.words)
                result = await answered
            if steps.lasting:
                await asyncio.get_running_loop().create_future()
        except asyncio.CancelledError:
            if steps.command and self._commanded:
                try:
                    steps.command.publish(steps.command.cancel, self._values)
                except (RosError, FieldError) as error:
                    log.warning("an action could not be cancelled", reason=str(error))
            raise
        finally:
            if answered:
                answered.cancel()
        return result

    def _report_progress(self, text: str) -> None:
        if self._resumed.is_set():
            self._report(ActionReport(self._action_id, ActionStatus.RUNNING, text))
