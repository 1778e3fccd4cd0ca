"""Kinds of ``[[operations]]``: wait for a message, charge, set a turn signal, and dock by a short drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from nena_edge_agent.actions.plugin import ActionPlugin, PluginContext
from nena_edge_agent.actions.ready_made import OperationKind, RosParts, ros_action
from nena_edge_agent.actions.settings import ActionSettings, CommandSettings, ParameterSettings
from nena_edge_agent.extension import Extension
from nena_edge_agent.extensions.action_kinds.docking import Docking
from nena_edge_agent.extensions.action_kinds.settings import (
    ChargeOperationSettings,
    DockOperationSettings,
    SignalOperationSettings,
    TurnSignalSettings,
)
from nena_shared.vda5050.factsheet import ActionScope

DIRECTION = "direction"


def _wait_for_message(
    operation: SignalOperationSettings, path: str, context: PluginContext, settings: ActionSettings
) -> ActionPlugin:
    return ros_action(operation, RosParts(answer=operation.answer), path, context, settings)


def _charge(
    operation: ChargeOperationSettings, path: str, context: PluginContext, settings: ActionSettings
) -> ActionPlugin:
    parts = RosParts(operation.command, operation.call, operation.confirmation)
    return ros_action(operation, parts, path, context, settings)


def _set_turn_signal(
    operation: TurnSignalSettings, path: str, context: PluginContext, settings: ActionSettings
) -> ActionPlugin:
    direction = ParameterSettings(key=DIRECTION, values=operation.values, description="what the signal shows")
    command = CommandSettings(
        topic=operation.topic,
        type=operation.type,
        fields={operation.field: f"{{{DIRECTION}}}"},
        on_cancel={operation.field: operation.values["off"]},
    )
    parts = RosParts(command=command, lasting=operation.scopes == (ActionScope.EDGE,))
    directed = operation.model_copy(update={"parameters": (*operation.parameters, direction)})
    return ros_action(directed, parts, path, context, settings)


def _dock(
    operation: DockOperationSettings,
    path: str,  # noqa: ARG001 - the interface
    context: PluginContext,
    settings: ActionSettings,  # noqa: ARG001
) -> ActionPlugin:
    return Docking(operation, context.drive)


class ActionKinds(Extension):
    """Adds the kinds ``signal``, ``charge``, ``turn_signal`` and ``dock``."""

    kinds: ClassVar[Mapping[str, OperationKind]] = {
        "signal": OperationKind(SignalOperationSettings, _wait_for_message),
        "charge": OperationKind(ChargeOperationSettings, _charge),
        "turn_signal": OperationKind(TurnSignalSettings, _set_turn_signal),
        "dock": OperationKind(DockOperationSettings, _dock),
    }
