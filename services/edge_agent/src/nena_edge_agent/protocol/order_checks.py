"""Checks that new orders and updates have in common (sections 6.1.2 and 6.1.4)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, pairwise

from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.ground import Footprint, first_closed, zones_in
from nena_edge_agent.protocol.load_handling import first_load_problem
from nena_edge_agent.protocol.optional_parameters import unsupported
from nena_edge_agent.protocol.situation import Situation
from nena_edge_agent.protocol.tolerance import distance, in_place, radius
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Node, NodePosition, Order
from nena_shared.vda5050.own_actions import START_ROS_SESSION

STRAY = 1.0
"""Metres that a robot may have come to rest beside the node that it has reached, at most."""


def general_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check what is asked of every order, whether it is new or an update: 2 to 5."""
    return (
        _mode_fault(order, situation)
        or _size_fault(order, capabilities)
        or _parameter_fault(order, capabilities)
        or _action_fault(order, capabilities)
    )


def _mode_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check 2."""
    if situation.operating_mode.takes_orders:
        return _off_fault(order, situation) or (_fatal_fault(order) if situation.fatal else None)
    return refusal(
        ErrorType.MOBILE_ROBOT_NOT_AVAILABLE,
        order,
        f"the robot is in mode {situation.operating_mode} and takes no orders",
        hint="switch the robot to AUTOMATIC",
    )


def _off_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    if not situation.off:
        return None
    return refusal(
        ErrorType.MOBILE_ROBOT_NOT_AVAILABLE,
        order,
        f"the robot takes no orders: {situation.off}",
        hint=f"have it started by the instant action {START_ROS_SESSION}",
    )


def _fatal_fault(order: Order) -> ErrorEntry:
    return refusal(
        ErrorType.MOBILE_ROBOT_NOT_AVAILABLE,
        order,
        "the robot has a fatal error and takes no orders",
        hint="the errors of the level FATAL say what a person has to see to",
    )


def _size_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 3."""
    actions = sum(1 for _ in _scoped_actions(order))
    for count, limit, what in (
        (len(order.nodes), capabilities.maximum_nodes, "nodes"),
        (actions, capabilities.maximum_actions, "actions"),
    ):
        if count > limit:
            return refusal(
                ErrorType.INSUFFICIENT_MEMORY,
                order,
                f"the order has {count} {what}, the robot takes {limit}",
                hint="send the order in parts",
            )
    return None


def _parameter_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 4."""
    found = unsupported(order, capabilities)
    if found is None:
        return None
    name, edge = found
    return refusal(
        ErrorType.UNSUPPORTED_PARAMETER,
        order,
        f"the robot cannot act on {name}" + (f" of edge '{edge.edge_id}'" if edge else ""),
        hint="leave it out, or have the agent tolerate it by its setting tolerated_parameters",
        parameter=name,
        edge_id=edge.edge_id if edge else None,
    )


def _action_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check 5, for the horizon as well."""
    for scope, action in _scoped_actions(order):
        declaration = capabilities.actions.get(action.action_type)
        problem = (
            declaration.problem(action, scope)
            if declaration
            else f"the robot knows no action '{action.action_type}'"
        )
        if problem:
            return refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                problem,
                hint="the factsheet lists the robot's actions",
                action_id=action.action_id,
            )
    return None


def load_fault(
    order: Order, situation: Situation, capabilities: Capabilities, *, skip: int = 0
) -> ErrorEntry | None:
    """Check that each action which takes or gives a load will find the robot so that it can.

    The robot's actions are done one after the other in driving order; the first ``skip`` nodes do not count.
    """
    placed = [(node.sequence_id, node.actions) for node in order.nodes[skip:]]
    placed += [(edge.sequence_id, edge.actions) for edge in order.edges]
    in_order = chain.from_iterable(actions for _, actions in sorted(placed, key=lambda each: each[0]))
    found = first_load_problem(in_order, capabilities.actions, loaded=situation.loaded)
    if found is None:
        return None
    action, problem = found
    hint = "the state's loads say what the robot carries; order the actions so that they fit it"
    return refusal(ErrorType.INVALID_ORDER_ACTION, order, problem, hint=hint, action_id=action.action_id)


def map_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check A3."""
    for node in order.nodes:
        position = node.node_position
        if position and position.map_id not in situation.maps:
            return refusal(
                ErrorType.UNKNOWN_MAP_ID,
                order,
                f"node '{node.node_id}' is on '{position.map_id}', the robot has {listed(situation.maps)}",
                hint="bring the map to the robot, or compare the plant model with the agent's setting map_id",
                node_id=node.node_id,
            )
    return None


def route_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A5: a way has to lead to each node. The first one is where the robot is."""
    for before, node in pairwise(order.nodes):
        fault = _way_fault(before.node_position, node, situation, capabilities.footprint)
        if fault is not None:
            problem, hint = fault
            return refusal(ErrorType.NO_ROUTE_TO_TARGET, order, problem, hint=hint, node_id=node.node_id)
    return None


def _way_fault(
    start: NodePosition | None, node: Node, situation: Situation, footprint: Footprint
) -> tuple[str, str] | None:
    """Say why no way leads to ``node``, and what to do about it."""
    place = node.node_position
    if place is None:
        hint = "the robot drives to coordinates only; send nodePosition with every node"
        return f"node '{node.node_id}' has no nodePosition", hint
    if any(area.holds(place.x, place.y) for area in situation.no_route):
        return (
            f"no way leads to node '{node.node_id}'",
            "see what blocks the way, or send the robot elsewhere",
        )
    begin = start or place
    if begin.map_id != place.map_id:
        text = f"node '{node.node_id}' is on map '{place.map_id}', the one before it on '{begin.map_id}'"
        return text, "the robot does not drive from map to map; set its position on the other one"
    if not situation.closed:
        return None
    zone = first_closed(zones_in(footprint.way(begin, place), place.map_id, situation.closed))
    if zone is None:
        return None
    text = f"the way to node '{node.node_id}' leads through zone '{zone.zone.zone_id}'"
    return text, f"the zone is {zone.zone.zone_type}: lead the order around it, or enable another zone set"


def listed(maps: Iterable[str]) -> str:
    """Name the maps that a robot has."""
    return ", ".join(f"'{each}'" for each in sorted(maps)) or "none"


def repeated_action_fault(order: Order, used: frozenset[str], *, skip: int = 0) -> ErrorEntry | None:
    """Check that no id of an action would stand for two; the first ``skip`` nodes do not count."""
    for _, action in _scoped_actions(order, skip=skip):
        if action.action_id in used:
            return refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                f"the actionId '{action.action_id}' is used by another action",
                hint="give each action an id of its own",
                action_id=action.action_id,
            )
    return None


def stands_on(node: Node, situation: Situation, capabilities: Capabilities) -> bool:
    """Tell whether the robot is at ``node``; one that somebody has driven away is not where it stood."""
    pose, position = situation.pose, node.node_position
    strayed = pose and position and distance(pose, position) > radius(position, 0.0) + STRAY
    if situation.stands_on and situation.stands_on == node.node_id and not strayed:
        return True
    return bool(pose and position and in_place(pose, position, capabilities.default_deviation_xy))


def _scoped_actions(order: Order, *, skip: int = 0) -> Iterator[tuple[ActionScope, Action]]:
    on_nodes = ((ActionScope.NODE, action) for node in order.nodes[skip:] for action in node.actions)
    on_edges = ((ActionScope.EDGE, action) for edge in order.edges for action in edge.actions)
    return chain(on_nodes, on_edges)


def refusal(
    kind: ErrorType, order: Order, description: str, *, hint: str, **references: str | None
) -> ErrorEntry:
    """Make the error of a refused order; what is not known of the references is left out (6.6.5.4)."""
    return error(
        kind,
        description,
        hint=hint,
        topic="order",
        header_id=order.header_id,
        order_id=order.order_id,
        order_update_id=order.order_update_id,
        **references,
    )
