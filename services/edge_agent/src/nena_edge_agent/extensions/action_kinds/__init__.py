"""Kinds of ``[[operations]]``: wait for a message, charge, set a turn signal, and dock by a short drive."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.actions.ready_made import OperationKind, OperationMaker, RosParts
from nena_edge_agent.actions.settings import CommandSettings, ParameterSettings
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


def _set_turn_signal(operation: TurnSignalSettings, maker: OperationMaker) -> ActionPlugin:
    direction = ParameterSettings(key=DIRECTION, values=operation.values, description="what the signal shows")
    command = CommandSettings(
        topic=operation.topic,
        type=operation.type,
        fields={operation.field: f"{{{DIRECTION}}}"},
        on_cancel={operation.field: operation.values["off"]},
    )
    directed = operation.model_copy(update={"parameters": (*operation.parameters, direction)})
    # An action of an edge ends with its edge (VDA 5050, 6.2.2; 2.1: 6.12); one of a node would never end.
    return maker.ros_action(directed, RosParts(command, lasting=operation.scopes == (ActionScope.EDGE,)))


class ActionKinds(Extension):
    """Adds the kinds ``signal``, ``charge``, ``turn_signal`` and ``dock``."""

    kinds: ClassVar[Mapping[str, OperationKind]] = {
        "signal": OperationKind(
            SignalOperationSettings,
            lambda operation, maker: maker.ros_action(operation, RosParts(answer=operation.answer)),
        ),
        "charge": OperationKind(
            ChargeOperationSettings,
            lambda operation, maker: maker.ros_action(
                operation, RosParts(operation.command, operation.call, operation.confirmation)
            ),
        ),
        "turn_signal": OperationKind(TurnSignalSettings, _set_turn_signal),
        "dock": OperationKind(
            DockOperationSettings, lambda operation, maker: Docking(operation, maker.context.drive)
        ),
    }
