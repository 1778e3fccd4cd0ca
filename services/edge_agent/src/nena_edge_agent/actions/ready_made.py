"""Creates the actions of ``[[operations]]``: timed ones, and those that use ROS without code."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

from nena_edge_agent.actions.builtin import SimulatedOperation, TimedOperation, Unavailable
from nena_edge_agent.actions.messages import Record, UnknownTypeError, message_type, service_type
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


@dataclass(frozen=True, slots=True)
class OperationKind:
    """A kind of ``[[operations]]``: its settings, and what makes an action of them.

    ``make`` gets the settings, their place in the file for errors, the robot and the settings of all actions.
    """

    settings: type[OperationBase]
    make: Callable[[Any, str, PluginContext, ActionSettings], ActionPlugin]


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
        path = f"operations.{number}"
        match operation:
            case OperationSettings():
                yield TimedOperation(operation)
            case TopicOperationSettings():
                parts = RosParts(command=operation.command, answer=operation.answer)
                yield ros_action(operation, parts, path, context, settings)
            case ServiceOperationSettings():
                parts = RosParts(call=operation.call, answer=operation.answer)
                yield ros_action(operation, parts, path, context, settings)
            case Nav2OperationSettings():
                yield _by_nav2(operation, context.ros, settings)
            case _:
                yield kinds[operation.kind].make(operation, path, context, settings)


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


def _by_nav2(operation: Nav2OperationSettings, ros: RosPort | None, settings: ActionSettings) -> ActionPlugin:
    declaration = declaration_of(operation)
    if ros is None and settings.without_ros == "rehearse":
        return SimulatedOperation(declaration, settings.rehearsal_seconds, charging=operation.charging)
    if ros is None:
        return Unavailable(declaration)
    try:
        return Nav2Operation(operation, ros)
    except RosError as error:
        return Unavailable(declaration, str(error))


def ros_action(
    operation: RosOperationSettings,
    parts: RosParts,
    path: str,
    context: PluginContext,
    settings: ActionSettings,
) -> ActionPlugin:
    """Return the action that publishes, calls and waits as its parts say; without ROS a rehearsed one."""
    ros, values = context.ros, ActionValues(operation)
    declaration = _declaration(operation, parts, values)
    if ros is not None:
        steps = _steps(parts, values, path, ros)
        checked = replace(declaration, check=lambda action: steps.problem(values.of(action)))
        return RosOperation(checked, steps, values, charging=operation.charging)
    if settings.without_ros == "rehearse":
        return SimulatedOperation(declaration, settings.rehearsal_seconds, charging=operation.charging)
    return Unavailable(declaration)


def _declaration(operation: RosOperationSettings, parts: RosParts, values: ActionValues) -> ActionDeclaration:
    return ActionDeclaration(
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


def _steps(parts: RosParts, values: ActionValues, path: str, ros: RosPort) -> Steps:
    return Steps(
        command=_command(parts.command, values, f"{path}.command", ros) if parts.command else None,
        call=_call(parts.call, values, f"{path}.call", ros) if parts.call else None,
        answer=_answer(parts.answer, values, f"{path}.answer", ros) if parts.answer else None,
        lasting=parts.lasting,
    )


def _command(settings: CommandSettings, values: ActionValues, path: str, ros: RosPort) -> Command:
    shape = _message(settings.type, path)
    return Command(settings, ros.publisher(settings.topic, settings.type), shape, values, path)


def _call(settings: CallSettings, values: ActionValues, path: str, ros: RosPort) -> Call:
    try:
        shapes = service_type(settings.type)
    except UnknownTypeError as error:
        raise ConfigurationError([f"{path}.type: {error}"]) from error
    return Call(settings, ros.client(settings.service, settings.type), shapes, values, path)


def _answer(settings: AnswerSettings, values: ActionValues, path: str, ros: RosPort) -> Answer:
    return Answer(settings, ros, _message(settings.type, path), values, path)


def _message(name: str, path: str) -> Record:
    try:
        return message_type(name)
    except UnknownTypeError as error:
        raise ConfigurationError([f"{path}.type: {error}"]) from error
