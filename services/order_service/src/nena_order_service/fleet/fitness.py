"""Whether a robot can take a message at all, by its factsheet (VDA 5050 3.0 section 7.10)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final

from nena_order_service.fleet.mission import Mission
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MobileRobotAction, Support
from nena_shared.vda5050.order import Node

ALWAYS_THERE: Final = frozenset({"cancelOrder", "stateRequest", "factsheetRequest"})
"""Instant actions that the standard asks of every robot, whether its factsheet lists them or not."""

_FILLED: Final = {
    "nodePosition": lambda node: node.node_position is not None,
    "nodePosition.theta": lambda node: (
        node.node_position is not None and node.node_position.theta is not None
    ),
    "nodePosition.allowedDeviationXY": (
        lambda node: node.node_position is not None and node.node_position.allowed_deviation_xy is not None
    ),
    "nodePosition.allowedDeviationTheta": (
        lambda node: node.node_position is not None and node.node_position.allowed_deviation_theta is not None
    ),
}
"""Optional fields of nodes that missions may hold, and whether a node has each."""
_LEFT_OUT: Final = {
    "nodePosition.allowedDeviationXY": "allowed_deviation_xy",
    "nodePosition.allowedDeviationTheta": "allowed_deviation_theta",
}
"""Those that a robot may not know; without a position it could not find the node, so that is always sent."""
_NODES: Final = "nodes."


def order_problem(mission: Mission, factsheet: Factsheet) -> str | None:
    """Say why the robot cannot take the mission; None if nothing is known against it."""
    return next(_order_problems(mission, factsheet), None)


def instant_action_problem(action: Action, factsheet: Factsheet) -> str | None:
    """Say why the robot cannot take an instant action; None if nothing is known against it."""
    if action.action_type in ALWAYS_THERE:
        return None
    return next(_action_problems(action, ActionScope.INSTANT, factsheet), None)


def fitted(mission: Mission, factsheet: Factsheet) -> Mission:
    """Leave out the optional fields that the robot's factsheet does not list, if it lists any."""
    listed = {each.parameter for each in factsheet.protocol_features.optional_parameters}
    unknown = [name for name in _LEFT_OUT if listed and not any(each.endswith(name) for each in listed)]
    if not unknown:
        return mission
    without = dict.fromkeys((_LEFT_OUT[name] for name in unknown), None)
    nodes = tuple(
        node.model_copy(update={"node_position": node.node_position.model_copy(update=without)})
        if node.node_position
        else node
        for node in mission.nodes
    )
    return mission.model_copy(update={"nodes": nodes})


def _order_problems(mission: Mission, factsheet: Factsheet) -> Iterator[str]:
    limits = factsheet.protocol_limits.maximum_array_lengths
    yield from _too_many(len(mission.nodes), limits.order_nodes, "nodes")
    yield from _too_many(len(mission.edges), limits.order_edges, "edges")
    for node in mission.nodes:
        yield from _too_many(len(node.actions), limits.node_actions, f"actions on node '{node.node_id}'")
        for action in node.actions:
            yield from _action_problems(action, ActionScope.NODE, factsheet)
    for edge in mission.edges:
        yield from _too_many(len(edge.actions), limits.edge_actions, f"actions on edge '{edge.edge_id}'")
        for action in edge.actions:
            yield from _action_problems(action, ActionScope.EDGE, factsheet)
    yield from _missing_fields(mission.nodes, factsheet)
    yield from _bad_ids(_ids(mission), factsheet)


def _action_problems(action: Action, scope: ActionScope, factsheet: Factsheet) -> Iterator[str]:
    limits = factsheet.protocol_limits.maximum_array_lengths
    yield from _too_many(
        len(action.action_parameters), limits.action_parameters, f"parameters of '{action.action_type}'"
    )
    declared = factsheet.protocol_features.mobile_robot_actions
    if not declared:
        return  # a factsheet that lists none leaves them out, rather than that the robot can do nothing
    known = [each for each in declared if each.action_type == action.action_type]
    if not known:
        yield f"its factsheet does not list the action '{action.action_type}'"
        return
    yield from _declaration_problems(action, scope, known[0])


def _declaration_problems(action: Action, scope: ActionScope, declared: MobileRobotAction) -> Iterator[str]:
    name = f"the action '{action.action_type}'"
    if declared.action_scopes and scope not in declared.action_scopes:
        yield f"its factsheet lists {name} for {', '.join(declared.action_scopes)}, not for {scope}"
    blocking = declared.blocking_types
    if scope is not ActionScope.INSTANT and blocking and action.blocking_type not in blocking:
        yield f"its factsheet lists {name} for the blocking types {', '.join(blocking)}"
    given = {each.key for each in action.action_parameters}
    for parameter in declared.action_parameters or ():
        if parameter.is_optional is False and parameter.key not in given:
            yield f"{name} needs the parameter '{parameter.key}' there"


def _missing_fields(nodes: Iterable[Node], factsheet: Factsheet) -> Iterator[str]:
    """Look for fields that the robot demands and the mission does not have."""
    for each in factsheet.protocol_features.optional_parameters:
        if each.support is not Support.REQUIRED:
            continue
        field = each.parameter.removeprefix("order.")
        filled = _FILLED.get(field.removeprefix(_NODES)) if field.startswith(_NODES) else None
        if filled is None:
            yield f"its factsheet demands the field '{each.parameter}', which orders here never have"
        elif not all(map(filled, nodes)):
            yield f"its factsheet demands the field '{each.parameter}', which not every node has"


def _bad_ids(ids: Iterable[str], factsheet: Factsheet) -> Iterator[str]:
    limits = factsheet.protocol_limits.maximum_string_lengths
    for each in ids:
        if limits.maximum_id_length and len(each) > limits.maximum_id_length:
            yield f"the id '{each}' is longer than {limits.maximum_id_length} characters"
        if limits.id_numerical_only and not each.isdecimal():
            yield f"its factsheet demands ids of digits only, not '{each}'"


def _ids(mission: Mission) -> Iterator[str]:
    yield mission.mission_id
    yield from (node.node_id for node in mission.nodes)
    yield from (edge.edge_id for edge in mission.edges)
    yield from (action.action_id for node in mission.nodes for action in node.actions)


def _too_many(count: int, limit: int | None, what: str) -> Iterator[str]:
    if limit and count > limit:
        yield f"its factsheet allows {limit} {what}, not {count}"
