"""Makes a message fit a robot's factsheet where that changes nothing of what is asked (section 7.10)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import pairwise
from math import atan2, hypot, pi
from types import MappingProxyType
from typing import Any, Final

from pydantic import JsonValue
from pydantic_core import from_json

from nena_order_service.fleet.abilities import Abilities
from nena_order_service.fleet.mission import Mission
from nena_order_service.fleet.mission_builder import GOAL_PREFIX
from nena_order_service.fleet.operations import STATION_PARAMETERS
from nena_shared.vda5050.action import Action, ActionParameter
from nena_shared.vda5050.factsheet import ActionParameterDescription, ValueDataType
from nena_shared.vda5050.order import Edge, Node, NodePosition

XY: Final = "nodes.nodePosition.allowedDeviationXY"
THETA: Final = "nodes.nodePosition.theta"
DEVIATION_THETA: Final = "nodes.nodePosition.allowedDeviationTheta"
ACTION_DESCRIPTOR: Final = "nodes.actions.actionDescriptor"


def fitted(mission: Mission, abilities: Abilities) -> Mission:
    """Leave out the optional fields that the robot does not take, and fill those that it demands.

    What would change the order stays as it is, for :mod:`nena_order_service.fleet.fitness` to name: a
    position, and the heading at a coordinate.
    """
    nodes = mission.nodes
    headings = _headings(nodes)
    return mission.model_copy(
        update={
            "nodes": tuple(
                _fitted_node(node, heading, abilities) for node, heading in zip(nodes, headings, strict=True)
            ),
            "edges": tuple(
                _fitted_edge(edge, ends, abilities)
                for edge, ends in zip(mission.edges, pairwise(nodes), strict=True)
            ),
        }
    )


def fitted_action(action: Action, abilities: Abilities) -> Action:
    """Give each parameter the type that the robot wants, where the value says so unmistakably.

    Where and what kind of load it is says fleet control of its own accord; a robot that lists its
    parameters, and these not among them, is not told.
    """
    wanted = abilities.parameters(action)
    parameters = tuple(
        _typed(each, wanted.get(each.key))
        for each in action.action_parameters
        if not wanted or each.key in wanted or each.key not in STATION_PARAMETERS
    )
    return action.model_copy(update={"action_parameters": parameters})


def _fitted_node(node: Node, heading: float, abilities: Abilities) -> Node:
    changes: dict[str, Any] = {
        "actions": tuple(_fitted_on_node(each, abilities) for each in node.actions),
    }
    if node.node_position is not None:
        changes["node_position"] = _fitted_position(node, node.node_position, heading, abilities)
    if "nodes.nodeDescriptor" in abilities.required_fields:
        changes["node_descriptor"] = node.node_id
    return node.model_copy(update=changes)


def _fitted_on_node(action: Action, abilities: Abilities) -> Action:
    action = fitted_action(action, abilities)
    if action.retriable and not abilities.takes_retries:
        action = action.model_copy(update={"retriable": None})
    if ACTION_DESCRIPTOR in abilities.required_fields:
        return action.model_copy(update={"action_descriptor": action.action_descriptor or action.action_type})
    if not abilities.takes_field(ACTION_DESCRIPTOR):
        return action.model_copy(update={"action_descriptor": None})
    return action


def _fitted_position(
    node: Node, position: NodePosition, heading: float, abilities: Abilities
) -> NodePosition:
    """Leave out or fill; a heading with every deviation allowed is one that nobody has to take up."""
    demanded = abilities.required_fields
    changes: dict[str, Any] = {}
    if not abilities.takes_field(XY):
        changes["allowed_deviation_xy"] = None
    if not abilities.takes_field(THETA) and not node.node_id.startswith(GOAL_PREFIX):
        changes["theta"] = None
    free = changes.get("theta", position.theta) is None
    if free and THETA in demanded and abilities.takes_field(DEVIATION_THETA):
        changes |= {"theta": heading, "allowed_deviation_theta": pi}
    elif free and DEVIATION_THETA in demanded:
        changes["allowed_deviation_theta"] = pi
    if not abilities.takes_field(DEVIATION_THETA):
        changes["allowed_deviation_theta"] = None
    return position.model_copy(update=changes)


def _fitted_edge(edge: Edge, ends: tuple[Node, Node], abilities: Abilities) -> Edge:
    changes = {
        field: fill(edge, ends, abilities)
        for path, (field, fill) in _EDGE_FIELDS.items()
        if path in abilities.required_fields
    }
    return edge.model_copy(update=changes)


def _distance(_: Edge, ends: tuple[Node, Node], __: Abilities) -> float | None:
    start, end = (node.node_position for node in ends)
    return hypot(end.x - start.x, end.y - start.y) if start and end else None


def _speed(_: Edge, __: tuple[Node, Node], abilities: Abilities) -> float | None:
    return abilities.factsheet.physical_parameters.maximum_speed or None


def _rotation_speed(_: Edge, __: tuple[Node, Node], abilities: Abilities) -> float | None:
    return abilities.factsheet.physical_parameters.maximum_angular_speed or None


_Fill = Callable[[Edge, tuple[Node, Node], Abilities], object]
_EDGE_FIELDS: Final[Mapping[str, tuple[str, _Fill]]] = MappingProxyType(
    {
        "edges.edgeDescriptor": ("edge_descriptor", lambda edge, *_: edge.edge_id),
        "edges.length": ("length", _distance),
        "edges.maximumSpeed": ("maximum_speed", _speed),
        "edges.maximumRotationSpeed": ("maximum_rotation_speed", _rotation_speed),
        "edges.reachOrientationBeforeEntering": (
            "reach_orientation_before_entering",
            lambda *_: False,
        ),
    }
)
"""What an edge says if the robot demands it; it asks for nothing that the robot would not do anyway."""


def _headings(nodes: tuple[Node, ...]) -> Iterator[float]:
    """Give the way that a robot looks when it comes to each node forwards and straight, rad.

    It depends on nothing behind the node, so that an update may repeat the node as it was.
    """
    yield 0.0
    heading = 0.0
    for start, end in pairwise(node.node_position for node in nodes):
        if start and end and (start.x, start.y) != (end.x, end.y):
            heading = atan2(end.y - start.y, end.x - start.x)
        yield heading


def _typed(parameter: ActionParameter, wanted: ActionParameterDescription | None) -> ActionParameter:
    """Read a text as what it is wanted as; one that cannot be read so stays a text."""
    if wanted is None or not isinstance(parameter.value, str):
        return parameter
    with suppress(ValueError, KeyError):
        return ActionParameter(key=parameter.key, value=_READ[wanted.value_data_type](parameter.value))
    return parameter


def _boolean(text: str) -> bool:
    return {"true": True, "false": False}[text.strip().lower()]


def _json(text: str) -> JsonValue:
    value: JsonValue = from_json(text)  # refuses what is nested deeper than messages may be
    return value if isinstance(value, dict | list) else text


_READ: Final[Mapping[ValueDataType, Callable[[str], JsonValue]]] = MappingProxyType(
    {
        ValueDataType.BOOL: _boolean,
        ValueDataType.NUMBER: float,
        ValueDataType.INTEGER: int,
        ValueDataType.STRING: str,
        ValueDataType.OBJECT: _json,
        ValueDataType.ARRAY: _json,
    }
)
