"""Creates the actions of ``[[operations]]``: timed ones, and those that use ROS without code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, TypeVar

from nena_edge_agent.actions.builtin import SimulatedOperation, TimedOperation, Unavailable
from nena_edge_agent.actions.messages import UnknownTypeError, message_type, service_type
from nena_edge_agent.actions.nav2_operations import Nav2Operation, declaration_of
from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext, RosError, RosPort
from nena_edge_agent.actions.ros_operations import ActionValues, Answer, Call, Command, RosOperation, Steps
from nena_edge_agent.actions.settings import (
    ActionSettings,
    AnswerSettings,
    CallSettings,
    CommandSettings,
    Nav2OperationSettings,
    OperationBase,
    OperationSettings,
    RosOperationSettings,
    ServiceOperationSettings,
    TopicOperationSettings,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_shared.settings import ConfigurationError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class OperationKind:
    """A kind of ``[[operations]]``: the model of its table, and what makes an action of one."""

    settings: type[OperationBase]
    make: Callable[[Any, OperationMaker], ActionPlugin]


def ready_made(
    operations: Iterable[OperationBase],
    context: PluginContext,
    settings: ActionSettings,
    kinds: Mapping[str, OperationKind] = MappingProxyType({}),
) -> Iterator[ActionPlugin]:
    """Build the actions of one robot; ``kinds`` are those of extensions.

    Raises:
        ConfigurationError: a message cannot be built from the settings; the error names the setting.
    """
    for number, operation in enumerate(operations):
        maker = OperationMaker(f"operations.{number}", context, settings)
        match operation:
            case OperationSettings():
                yield TimedOperation(operation)
            case TopicOperationSettings():
                yield maker.ros_action(operation, RosParts(operation.command, answer=operation.answer))
            case ServiceOperationSettings():
                yield maker.ros_action(operation, RosParts(call=operation.call, answer=operation.answer))
            case Nav2OperationSettings():
                yield maker.nav2_action(operation)
            case _:
                yield kinds[operation.kind].make(operation, maker)


@dataclass(frozen=True, slots=True)
class RosParts:
    """The parts of an action that uses ROS, as defined in its settings."""

    command: CommandSettings | None = None
    call: CallSettings | None = None
    answer: AnswerSettings | None = None
    lasting: bool = False

    @property
    def can_be_cancelled(self) -> bool:
        """Return whether the action can be cancelled: nothing that it has started continues then."""
        return self.call is None and (self.command is None or self.command.on_cancel is not None)


@dataclass(frozen=True, slots=True)
class OperationMaker:
    """Makes an action of one table; ``path`` is the table's name in errors."""

    path: str
    context: PluginContext
    settings: ActionSettings

    def nav2_action(self, operation: Nav2OperationSettings) -> ActionPlugin:
        """Return the action that runs an action of Nav2's own servers."""
        declaration = declaration_of(operation)
        if self.context.ros is None:
            return self._without_ros(declaration, charging=operation.charging)
        try:
            return Nav2Operation(operation, self.context.ros)
        except RosError as error:
            return Unavailable(declaration, str(error))

    def ros_action(self, operation: RosOperationSettings, parts: RosParts) -> ActionPlugin:
        """Return the action that publishes, calls and waits as its parts say."""
        values = ActionValues(operation)
        declaration = ActionDeclaration(
            operation.action_type,
            scopes=operation.scopes,
            parameters=values.declared,
            blocking_types=operation.blocking_types,
            pause_allowed=parts.command is not None and parts.command.on_pause is not None,
            cancel_allowed=parts.can_be_cancelled,
            open_ended=parts.lasting,
            restartable=operation.restartable,
            load=operation.load_change,
            timeout=operation.timeout,
            description=operation.description,
        )
        if self.context.ros is None:
            return self._without_ros(declaration, charging=operation.charging)
        steps = self._make_steps(parts, values, self.context.ros)
        checked = replace(declaration, check=lambda action: steps.problem(values.values_of(action)))
        return RosOperation(checked, steps, values, charging=operation.charging)

    def _without_ros(self, declaration: ActionDeclaration, *, charging: bool | None) -> ActionPlugin:
        if self.settings.without_ros == "rehearse":
            return SimulatedOperation(declaration, self.settings.rehearsal_seconds, charging=charging)
        return Unavailable(declaration)

    def _make_steps(self, parts: RosParts, values: ActionValues, ros: RosPort) -> Steps:
        command: Command | None = None
        call: Call | None = None
        answer: Answer | None = None
        if settings := parts.command:
            path = f"{self.path}.command"
            shape = _read_type(message_type, settings, path)
            publisher = ros.publisher(settings.topic, settings.type)
            command = Command(settings, publisher, shape, values, path)
        if service := parts.call:
            path = f"{self.path}.call"
            shapes = _read_type(service_type, service, path)
            call = Call(service, ros.client(service.service, service.type), shapes, values, path)
        if awaited := parts.answer:
            path = f"{self.path}.answer"
            answer = Answer(awaited, ros, _read_type(message_type, awaited, path), values, path)
        return Steps(command=command, call=call, answer=answer, lasting=parts.lasting)


def _read_type(
    read: Callable[[str], T], settings: CommandSettings | CallSettings | AnswerSettings, path: str
) -> T:
    try:
        return read(settings.type)
    except UnknownTypeError as error:
        raise ConfigurationError([f"{path}.type: {error}"]) from error
