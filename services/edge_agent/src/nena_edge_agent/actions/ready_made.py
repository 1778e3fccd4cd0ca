"""Creates the actions that the settings define: timed ones, and those that use ROS without code."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nena_edge_agent.actions.builtin import SimulatedOperation, TimedOperation, Unavailable
from nena_edge_agent.actions.docking import Docking
from nena_edge_agent.actions.messages import Record, UnknownTypeError, message_type, service_type
from nena_edge_agent.actions.nav2_operations import Nav2Operation, declaration_of
from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext, RosError, RosPort
from nena_edge_agent.actions.ros_operations import ActionValues, Answer, Call, Command, RosOperation, Steps
from nena_edge_agent.actions.settings import (
    ActionSettings,
    AnswerSettings,
    AnyOperation,
    CallSettings,
    ChargeOperationSettings,
    CommandSettings,
    DockOperationSettings,
    Nav2OperationSettings,
    OperationSettings,
    ParameterSettings,
    RosOperationSettings,
    ServiceOperationSettings,
    SignalOperationSettings,
    TopicOperationSettings,
    TurnSignalSettings,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.factsheet import ActionScope

DIRECTION = "direction"


def ready_made(
    operations: tuple[AnyOperation, ...], context: PluginContext, settings: ActionSettings
) -> Iterator[ActionPlugin]:
    """Build the actions of one robot.

    Raises:
        ConfigurationError: a message cannot be built from the settings; the error names the setting.
    """
    for number, operation in enumerate(operations):
        yield _made(operation, f"operations.{number}", context, settings)


@dataclass(frozen=True, slots=True)
class _Parts:
    """The parts of an action as defined in its settings."""

    command: CommandSettings | None = None
    call: CallSettings | None = None
    answer: AnswerSettings | None = None
    lasting: bool = False

    @property
    def can_be_cancelled(self) -> bool:
        """Return whether the action can be cancelled: nothing that it has started continues then."""
        return self.call is None and (self.command is None or self.command.on_cancel is not None)


def _made(
    operation: AnyOperation, path: str, context: PluginContext, settings: ActionSettings
) -> ActionPlugin:
    match operation:
        case OperationSettings():
            return TimedOperation(operation)
        case DockOperationSettings():
            return Docking(operation, context.drive)
        case Nav2OperationSettings():
            return _by_nav2(operation, context.ros, settings)
        case TurnSignalSettings():
            known = _with_direction(operation)
            return _with_ros(known, _signal_parts(known), path, context.ros, settings)
        case TopicOperationSettings():
            parts = _Parts(command=operation.command, answer=operation.answer)
        case ServiceOperationSettings():
            parts = _Parts(call=operation.call, answer=operation.answer)
        case SignalOperationSettings():
            parts = _Parts(answer=operation.answer)
        case ChargeOperationSettings():
            parts = _Parts(operation.command, operation.call, operation.confirmation)
    return _with_ros(operation, parts, path, context.ros, settings)


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


def _with_ros(
    operation: RosOperationSettings, parts: _Parts, path: str, ros: RosPort | None, settings: ActionSettings
) -> ActionPlugin:
    values = ActionValues(operation)
    declaration = _declaration(operation, parts, values)
    if ros is not None:
        steps = _steps(parts, values, path, ros)
        checked = replace(declaration, check=lambda action: steps.problem(values.of(action)))
        return RosOperation(checked, steps, values, charging=operation.charging)
    if settings.without_ros == "rehearse":
        return SimulatedOperation(declaration, settings.rehearsal_seconds, charging=operation.charging)
    return Unavailable(declaration)


def _declaration(operation: RosOperationSettings, parts: _Parts, values: ActionValues) -> ActionDeclaration:
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


def _steps(parts: _Parts, values: ActionValues, path: str, ros: RosPort) -> Steps:
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


def _with_direction(operation: TurnSignalSettings) -> TurnSignalSettings:
    direction = ParameterSettings(key=DIRECTION, values=operation.values, description="what the signal shows")
    return operation.model_copy(update={"parameters": (*operation.parameters, direction)})


def _signal_parts(operation: TurnSignalSettings) -> _Parts:
    lasting = operation.scopes == (ActionScope.EDGE,)
    command = CommandSettings(
        topic=operation.topic,
        type=operation.type,
        fields={operation.field: f"{{{DIRECTION}}}"},
        on_cancel={operation.field: operation.values["off"]},
    )
    return _Parts(command=command, lasting=lasting)
