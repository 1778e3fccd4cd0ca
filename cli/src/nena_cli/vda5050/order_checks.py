"""Orders and updates as fleet control sends them, and when it may (sections 6.1.1 to 6.1.4)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from nena_cli.vda5050.finding import Rule, Severity
from nena_cli.vda5050.header_checks import Problem
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.order import Node, Order
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import State

_HEADER = frozenset(Header.model_fields)


@dataclass(frozen=True, slots=True)
class Base:
    """The released part of an order as fleet control has sent it so far, over all updates."""

    order_id: str
    order_update_id: int
    last: Order
    nodes: dict[int, Node]
    """By sequenceId."""
    complete: bool
    """Whether the order was seen from its beginning."""

    @property
    def decision_point(self) -> Node:
        """The last released node."""
        return self.nodes[max(self.nodes)]


def new_order_problems(order: Order, rules: Rules) -> Iterator[Problem]:
    """Check an order whose id was not seen before."""
    if order.order_update_id and rules.first_update_id_is_zero:
        text = f"order '{order.order_id}' begins with orderUpdateId {order.order_update_id}, not 0"
        yield Rule.FIRST_UPDATE, Severity.ERROR, text
    if order.nodes[0].sequence_id:
        text = f"order '{order.order_id}' begins with sequenceId {order.nodes[0].sequence_id}, not 0"
        yield Rule.FIRST_UPDATE, Severity.ERROR, text


def situation_problems(order: Order, state: State | None) -> Iterator[Problem]:
    """Check whether a new order comes at a time when the robot may take it."""
    if state is None:
        return
    if not state.operating_mode.takes_orders:
        text = f"order '{order.order_id}' is sent to a robot in the mode {state.operating_mode}"
        yield Rule.MODE, Severity.ERROR, text
    busy = state.node_states or state.edge_states
    if busy and state.order_id != order.order_id:
        text = f"order '{order.order_id}' is sent while '{state.order_id}' is not ended"
        yield Rule.OTHER_ORDER, Severity.ERROR, text


def update_problems(order: Order, base: Base, rules: Rules, *, cancelled: bool) -> Iterator[Problem]:
    """Check an order whose id is that of the one before."""
    name = f"update {order.order_update_id} of order '{order.order_id}'"
    if order.order_update_id == base.order_update_id:
        if rules.equal_update_id_compared and _content(order) != _content(base.last):
            text = f"{name} comes again and says something else"
            yield Rule.UPDATE_ID, Severity.ERROR, text
        return
    if order.order_update_id < base.order_update_id:
        text = f"{name} comes after update {base.order_update_id}"
        yield Rule.UPDATE_ID, Severity.ERROR, text
        return
    if cancelled:
        yield Rule.UPDATE_AFTER_CANCEL, Severity.ERROR, f"{name} comes after the order's cancelOrder"
    yield from _stitching_problems(order, base, rules, name)


def extended(base: Base | None, order: Order) -> Base:
    """Give the base with what ``order`` releases; that of another order begins anew."""
    nodes = {node.sequence_id: node for node in order.nodes if node.released}
    complete = order.nodes[0].sequence_id == 0
    if base and base.order_id == order.order_id:
        nodes, complete = base.nodes | nodes, base.complete
    return Base(order.order_id, order.order_update_id, order, nodes, complete)


def _stitching_problems(order: Order, base: Base, rules: Rules, name: str) -> Iterator[Problem]:
    first, point = order.nodes[0], base.decision_point
    if (first.node_id, first.sequence_id) != (point.node_id, point.sequence_id):
        text = (
            f"{name} begins at node '{first.node_id}' ({first.sequence_id}), the base ends at "
            f"'{point.node_id}' ({point.sequence_id})"
        )
        yield Rule.STITCHING, Severity.ERROR, text
    elif rules.stitching_node_repeated and first != point:
        text = f"{name} changes the decision point '{first.node_id}'"
        yield Rule.STITCHING, Severity.ERROR, text


def _content(order: Order) -> str:
    return order.model_dump_json(exclude=set(_HEADER), exclude_none=True)
