"""Whether an order is taken: the decision procedure of sections 6.1.2 and 6.1.4, check by check, in order.

Nothing changes in the robot here; the verdict says what to do. Checks for well-formedness (schema and graph
rules) come before, in the codec. The numbers at the checks are the project's own: 2 to 5 for every message, A
for a new order, B for an update.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

from nena_edge_agent.driver.port import Circle, Pose
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.optional_parameters import unsupported
from nena_edge_agent.protocol.tolerance import distance, in_place, radius
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.order import Node, Order
from nena_shared.vda5050.state import OperatingMode

STRAY = 1.0
"""Metres that a robot may have come to rest beside the node that it has reached, at most."""


@dataclass(frozen=True, slots=True)
class Situation:
    """The robot as an order meets it.

    ``fatal``: somebody has shown an error with which the robot takes no orders. ``cancelled``: the held order
    was cancelled, or is being ended; ``cleared``: it was ended before its end, perhaps far from its base.
    ``pose`` is None unless it can be trusted, ``no_route`` are the areas that navigation knows no way into.
    ``stands_on`` is the node that the robot has reached and not left, or empty.
    """

    operating_mode: OperatingMode
    fatal: bool
    idle: bool
    cancelled: bool
    cleared: bool
    order_id: str
    order_update_id: int
    decision_point: tuple[str, int] | None
    pose: Pose | None
    no_route: tuple[Circle, ...]
    stands_on: str
    instant_action_ids: frozenset[str]
    base_action_ids: frozenset[str]


@dataclass(frozen=True, slots=True)
class NewOrder:
    """Take the order in place of the old one."""


@dataclass(frozen=True, slots=True)
class Update:
    """Put the order behind the base of the held one."""


@dataclass(frozen=True, slots=True)
class Duplicate:
    """The order was taken before: do nothing."""


@dataclass(frozen=True, slots=True)
class Rejected:
    """Refuse the order with this error."""

    error: ErrorEntry


Verdict = NewOrder | Update | Duplicate | Rejected


def judge(order: Order, situation: Situation, capabilities: Capabilities) -> Verdict:
    """Decide about ``order``."""
    fault = _identity_fault(order) or _general_fault(order, situation, capabilities)
    if fault is not None:
        return Rejected(fault)
    if order.order_id != situation.order_id:
        fault = _new_order_fault(order, situation, capabilities)
        return Rejected(fault) if fault else NewOrder()
    return _judge_update(order, situation, capabilities)


def _identity_fault(order: Order) -> ErrorEntry | None:
    """Check 1 as far as a schema cannot say it: the empty orderId stands for "no order" in the state."""
    if order.order_id:
        return None
    return _refusal(
        ErrorType.VALIDATION_FAILURE, order, "the orderId is empty", hint="give each order an id of its own"
    )


def _general_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    return (
        _mode_fault(order, situation)
        or _size_fault(order, capabilities)
        or _parameter_fault(order, capabilities)
        or _action_fault(order, capabilities)
    )


def _mode_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check 2."""
    if situation.operating_mode.takes_orders:
        return _fatal_fault(order) if situation.fatal else None
    return _refusal(
        ErrorType.MOBILE_ROBOT_NOT_AVAILABLE,
        order,
        f"the robot is in mode {situation.operating_mode} and takes no orders",
        hint="switch the robot to AUTOMATIC",
    )


def _fatal_fault(order: Order) -> ErrorEntry:
    return _refusal(
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
            return _refusal(
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
    return _refusal(
        ErrorType.UNSUPPORTED_PARAMETER,
        order,
        f"the robot cannot act on {name} of edge '{edge.edge_id}'",
        hint="leave it out, or have the agent tolerate it by its setting tolerated_parameters",
        parameter=name,
        edge_id=edge.edge_id,
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
            return _refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                problem,
                hint="the factsheet lists the robot's actions",
                action_id=action.action_id,
            )
    return None


def _new_order_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    if not situation.idle:  # A1
        return _refusal(
            ErrorType.OTHER_ORDER_ACTIVE,
            order,
            f"order '{situation.order_id}' is not ended",
            hint="wait for its end or cancel it",
        )
    return (
        _update_id_fault(order, capabilities)
        or _numbering_fault(order)
        or _repeated_action_fault(order, situation.instant_action_ids)
        or _map_fault(order, capabilities)
        or _start_fault(order.nodes[0], order, situation, capabilities)
        or _route_fault(order, situation)
    )


def _update_id_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A2."""
    if order.order_update_id == 0 or not capabilities.rules.standard.first_update_id_is_zero:
        return None
    return _refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        f"a new order begins with orderUpdateId 0, not {order.order_update_id}",
        hint="send the order from its beginning",
    )


def _numbering_fault(order: Order) -> ErrorEntry | None:
    """Check that the order comes from its beginning: one whose first message was lost lacks a part."""
    first = order.nodes[0].sequence_id
    if first == 0:
        return None
    return _refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        f"a new order begins with sequenceId 0, not {first}, and the robot does not hold '{order.order_id}'",
        hint="send the order from its beginning",
        node_id=order.nodes[0].node_id,
    )


def _map_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A3."""
    for node in order.nodes:
        position = node.node_position
        if position and position.map_id != capabilities.map_id:
            return _refusal(
                ErrorType.UNKNOWN_MAP_ID,
                order,
                f"node '{node.node_id}' is on map '{position.map_id}', the robot has '{capabilities.map_id}'",
                hint="compare the mapId of the plant model with the setting map_id of the agent",
                node_id=node.node_id,
            )
    return None


def _start_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check A4."""
    if _stands_on(first, situation, capabilities):
        return None
    pose = situation.pose
    place = f"it is at x {pose.x:.2f} m, y {pose.y:.2f} m" if pose else "its position is not known"
    return _refusal(
        ErrorType.START_NODE_OUT_OF_RANGE,
        order,
        f"the robot does not stand on the first node '{first.node_id}'; {place}",
        hint="begin the order where the robot stands, or give the first node a larger allowedDeviationXY"
        if pose
        else "set the robot's initial position",
        node_id=first.node_id,
    )


def _route_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check A5: navigation has to know a way to each node. The first one is where the robot is."""
    for node in order.nodes[1:]:
        place = node.node_position
        if place is None:
            problem = f"node '{node.node_id}' has no nodePosition"
            hint = "the robot drives to coordinates only; send nodePosition with every node"
        elif any(area.holds(place.x, place.y) for area in situation.no_route):
            problem = f"no way leads to node '{node.node_id}'"
            hint = "see what blocks the way, or send the robot elsewhere"
        else:
            continue
        return _refusal(ErrorType.NO_ROUTE_TO_TARGET, order, problem, hint=hint, node_id=node.node_id)
    return None


def _judge_update(order: Order, situation: Situation, capabilities: Capabilities) -> Verdict:
    fault = _outdated_fault(order, situation)
    if fault is None and order.order_update_id == situation.order_update_id:  # B3
        return Duplicate()
    fault = (
        fault
        or _stitching_fault(order, situation, capabilities)
        or _repeated_action_fault(order, situation.instant_action_ids | situation.base_action_ids, skip=1)
        or _map_fault(order, capabilities)
        or _route_fault(order, situation)
    )
    return Rejected(fault) if fault else Update()


def _outdated_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Checks B1 and B2."""
    if order.order_update_id < situation.order_update_id:
        return _refusal(
            ErrorType.OUTDATED_ORDER_UPDATE,
            order,
            f"update {order.order_update_id} is older than update {situation.order_update_id}, which is held",
            hint="continue from the orderUpdateId in the robot's state",
        )
    if situation.cancelled:
        return _refusal(
            ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL,
            order,
            "the order was cancelled",
            hint="send a new order",
        )
    return None


def _stitching_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Checks B4 and B5; after a normal end the decision point is the last node."""
    first = order.nodes[0]
    if (first.node_id, first.sequence_id) == situation.decision_point:
        return _absence_fault(first, order, situation, capabilities) if situation.cleared else None
    ends, hint = "was left by hand", "send a new order"
    if situation.decision_point:
        ends = "ends at '{}' with sequenceId {}".format(*situation.decision_point)
        hint = "begin the update with the last released node of the order"
    return _refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the update begins at node '{first.node_id}' with sequenceId {first.sequence_id}, the base {ends}",
        hint=hint,
        node_id=first.node_id,
    )


def _absence_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check that a robot whose order was cleared stands where its base ended."""
    if _stands_on(first, situation, capabilities):
        return None
    return _refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the order was cleared, and the robot does not stand on '{first.node_id}', where its base ended",
        hint="send a new order",
        node_id=first.node_id,
    )


def _stands_on(node: Node, situation: Situation, capabilities: Capabilities) -> bool:
    """Tell whether the robot is at ``node``; one that somebody has driven away is not where it stood."""
    pose, position = situation.pose, node.node_position
    strayed = pose and position and distance(pose, position) > radius(position, 0.0) + STRAY
    if situation.stands_on and situation.stands_on == node.node_id and not strayed:
        return True
    return bool(pose and position and in_place(pose, position, capabilities.default_deviation_xy))


def _repeated_action_fault(order: Order, used: frozenset[str], *, skip: int = 0) -> ErrorEntry | None:
    """Check that no id of an action would stand for two; the first ``skip`` nodes do not count."""
    for _, action in _scoped_actions(order, skip=skip):
        if action.action_id in used:
            return _refusal(
                ErrorType.INVALID_ORDER_ACTION,
                order,
                f"the actionId '{action.action_id}' is used by another action",
                hint="give each action an id of its own",
                action_id=action.action_id,
            )
    return None


def _scoped_actions(order: Order, *, skip: int = 0) -> Iterator[tuple[ActionScope, Action]]:
    on_nodes = ((ActionScope.NODE, action) for node in order.nodes[skip:] for action in node.actions)
    on_edges = ((ActionScope.EDGE, action) for edge in order.edges for action in edge.actions)
    return chain(on_nodes, on_edges)


def _refusal(
    kind: ErrorType, order: Order, description: str, *, hint: str, **references: str | None
) -> ErrorEntry:
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
