"""Whether an order is taken: the decision procedure of sections 6.1.2 and 6.1.4, check by check, in order.

Nothing changes in the robot here; the verdict says what to do. Checks for well-formedness (schema and graph
rules) come before, in the codec. The numbers at the checks are the project's own: 2 to 5 for every message, A
for a new order, B for an update.
"""

from __future__ import annotations

from dataclasses import dataclass

from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.order_checks import (
    general_fault,
    load_fault,
    map_fault,
    refusal,
    repeated_action_fault,
    route_fault,
    stands_on,
)
from nena_edge_agent.protocol.situation import Situation
from nena_edge_agent.protocol.update_acceptance import repeats, update_fault
from nena_shared.vda5050.error import ErrorEntry, ErrorType
from nena_shared.vda5050.order import Node, Order


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
    fault = _identity_fault(order) or general_fault(order, situation, capabilities)
    if fault is not None:
        return Rejected(fault)
    if order.order_id != situation.order_id:
        fault = _new_order_fault(order, situation, capabilities)
        return Rejected(fault) if fault else NewOrder()
    fault = update_fault(order, situation, capabilities)
    if fault is None and repeats(order, situation):
        return Duplicate()
    fault = fault or load_fault(order, situation, capabilities, skip=1)
    return Rejected(fault) if fault else Update()


def _identity_fault(order: Order) -> ErrorEntry | None:
    """Check 1 as far as a schema cannot say it: the empty orderId stands for "no order" in the state."""
    if order.order_id:
        return None
    return refusal(
        ErrorType.VALIDATION_FAILURE, order, "the orderId is empty", hint="give each order an id of its own"
    )


def _new_order_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    if not situation.idle:  # A1
        return refusal(
            ErrorType.OTHER_ORDER_ACTIVE,
            order,
            f"order '{situation.order_id}' is not ended",
            hint="wait for its end or cancel it",
        )
    return (
        _replay_fault(order, situation)
        or _update_id_fault(order, capabilities)
        or _numbering_fault(order)
        or repeated_action_fault(order, situation.instant_action_ids)
        or map_fault(order, situation)
        or _start_fault(order.nodes[0], order, situation, capabilities)
        or route_fault(order, situation, capabilities)
        or load_fault(order, situation, capabilities)
    )


def _replay_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Check that the message is not an old one that is sent again: what it asks for was done already."""
    problem = situation.history.replay(order)
    if problem is None:
        return None
    return refusal(
        ErrorType.OUTDATED_ORDER_UPDATE,
        order,
        f"{problem}; it is not carried out again",
        hint="send each order under a new orderId, with a higher headerId or the present time as timestamp",
    )


def _update_id_fault(order: Order, capabilities: Capabilities) -> ErrorEntry | None:
    """Check A2."""
    if order.order_update_id == 0 or not capabilities.rules.standard.first_update_id_is_zero:
        return None
    return refusal(
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
    return refusal(
        ErrorType.VALIDATION_FAILURE,
        order,
        f"a new order begins with sequenceId 0, not {first}, and the robot does not hold '{order.order_id}'",
        hint="send the order from its beginning",
        node_id=order.nodes[0].node_id,
    )


def _start_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check A4."""
    if stands_on(first, situation, capabilities):
        return None
    pose = situation.pose
    place = f"it is at x {pose.x:.2f} m, y {pose.y:.2f} m" if pose else "its position is not known"
    return refusal(
        ErrorType.START_NODE_OUT_OF_RANGE,
        order,
        f"the robot does not stand on the first node '{first.node_id}'; {place}",
        hint="begin the order where the robot stands, or give the first node a larger allowedDeviationXY"
        if pose
        else "set the robot's initial position",
        node_id=first.node_id,
    )
