"""Whether an update of the held order is taken: the checks B (sections 6.1.2 to 6.1.4)."""

from __future__ import annotations

from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.order_checks import (
    map_fault,
    refusal,
    repeated_action_fault,
    route_fault,
    stands_on,
)
from nena_edge_agent.protocol.order_content import fingerprint
from nena_edge_agent.protocol.situation import Situation
from nena_shared.vda5050.error import ErrorEntry, ErrorType
from nena_shared.vda5050.order import Node, Order


def update_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Tell what is wrong with an update of the held order that no general check has found."""
    fault = _outdated_fault(order, situation)
    if fault is None and repeats(order, situation):
        return _same_id_fault(order, situation, capabilities)
    return (
        fault
        or _stitching_fault(order, situation, capabilities)
        or repeated_action_fault(order, situation.instant_action_ids | situation.base_action_ids, skip=1)
        or map_fault(order, situation)
        or route_fault(order, situation, capabilities)
    )


def repeats(order: Order, situation: Situation) -> bool:
    """Tell whether the update has the number of the one that is held."""
    return order.order_update_id == situation.order_update_id


def _outdated_fault(order: Order, situation: Situation) -> ErrorEntry | None:
    """Checks B1 and B2."""
    if order.order_update_id < situation.order_update_id:
        return refusal(
            ErrorType.OUTDATED_ORDER_UPDATE,
            order,
            f"update {order.order_update_id} is older than update {situation.order_update_id}, which is held",
            hint="continue from the orderUpdateId in the robot's state",
        )
    if situation.cancelled:
        return refusal(
            ErrorType.ORDER_UPDATE_FOLLOWING_CANCEL,
            order,
            "the order was cancelled",
            hint="send a new order",
        )
    return None


def _same_id_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Check B3: a message that comes again is passed over, another one may not have its number."""
    held = situation.content if capabilities.rules.standard.equal_update_id_compared else None
    if held is None or held.whole == fingerprint(order):
        return None
    return refusal(
        ErrorType.SAME_ORDER_UPDATE_ID,
        order,
        f"update {order.order_update_id} is held already, and said something else",
        hint="give each update a higher orderUpdateId",
    )


def _stitching_fault(order: Order, situation: Situation, capabilities: Capabilities) -> ErrorEntry | None:
    """Checks B4 and B5; after a normal end the decision point is the last node."""
    first = order.nodes[0]
    if (first.node_id, first.sequence_id) == situation.decision_point:
        absence = _absence_fault(first, order, situation, capabilities) if situation.cleared else None
        return absence or _changed_fault(first, order, situation, capabilities)
    ends, hint = "was left by hand", "send a new order"
    if situation.decision_point:
        ends = "ends at '{}' with sequenceId {}".format(*situation.decision_point)
        hint = "begin the update with the last released node of the order"
    return refusal(
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
    if stands_on(first, situation, capabilities):
        return None
    return refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the order was cleared, and the robot does not stand on '{first.node_id}', where its base ended",
        hint="send a new order",
        node_id=first.node_id,
    )


def _changed_fault(
    first: Node, order: Order, situation: Situation, capabilities: Capabilities
) -> ErrorEntry | None:
    """Check that the stitching node is repeated as it was, where the version asks for that."""
    held = situation.content if capabilities.rules.standard.stitching_node_repeated else None
    if held is None or held.decision_node == fingerprint(first):
        return None
    return refusal(
        capabilities.rules.wrong_stitching_node,
        order,
        f"the update repeats node '{first.node_id}' with another content",
        hint="repeat the last released node of the order as it was; put new actions on a node behind it",
        node_id=first.node_id,
    )
