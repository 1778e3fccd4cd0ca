"""Orders and updates as fleet control sends them, and when it may (sections 6.1.1 to 6.1.4)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from nena_cli.vda5050.base import SentOrder
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State

HEADER: Final = frozenset(Header.model_fields)


def new_order_problems(order: Order) -> Iterator[Problem]:
    """Check an order whose id was not seen before."""
    if order.order_update_id:
        text = f"order '{order.order_id}' begins with orderUpdateId {order.order_update_id}, not 0"
        yield Rule.FIRST_UPDATE_ID, Severity.ERROR, text
    if order.nodes[0].sequence_id:
        text = f"order '{order.order_id}' begins with sequenceId {order.nodes[0].sequence_id}, not 0"
        yield Rule.FIRST_SEQUENCE_ID, Severity.ERROR, text


def situation_problems(order: Order, state: State | None, held: SentOrder | None) -> Iterator[Problem]:
    """Check whether an order comes at a time when the robot, by its last state, may take it.

    ``held`` is the order that the state echoes, as far as it is known.
    """
    if state is None:
        return
    if not state.operating_mode.takes_orders:
        text = f"order '{order.order_id}' is sent to a robot in the mode {state.operating_mode}"
        yield Rule.MODE, Severity.ERROR, text
    open_actions = {each.action_id for each in state.action_states if not each.action_status.ended}
    acts = held is not None and not open_actions.isdisjoint(held.actions)
    if state.order_id != order.order_id and (state.node_states or state.edge_states or acts):
        text = f"order '{order.order_id}' is sent while '{state.order_id}' is not ended"
        yield Rule.OTHER_ORDER, Severity.ERROR, text


def update_problems(order: Order, before: SentOrder, *, cancelled: bool) -> Iterator[Problem]:
    """Check an order whose id is that of the one before."""
    name = f"update {order.order_update_id} of order '{order.order_id}'"
    last = before.last.order_update_id
    if order.order_update_id == last:
        if _content(order) != _content(before.last):
            yield Rule.SAME_UPDATE_ID, Severity.ERROR, f"{name} comes again and says something else"
        return
    if order.order_update_id < last:
        yield Rule.OUTDATED_UPDATE, Severity.ERROR, f"{name} comes after update {last}"
        return
    if cancelled:
        yield Rule.UPDATE_AFTER_CANCEL, Severity.ERROR, f"{name} comes after the order's cancelOrder"
    yield from _stitching_problems(order, before, name)


def _stitching_problems(order: Order, before: SentOrder, name: str) -> Iterator[Problem]:
    first, point = order.nodes[0], before.decision_point
    if (first.node_id, first.sequence_id) != (point.node_id, point.sequence_id):
        text = (
            f"{name} begins at node '{first.node_id}' ({first.sequence_id}), the base ends at "
            f"'{point.node_id}' ({point.sequence_id})"
        )
        yield Rule.STITCHING, Severity.ERROR, text
    elif first != point:
        yield Rule.STITCHING_NODE, Severity.ERROR, f"{name} changes the decision point '{first.node_id}'"


def _content(order: Order) -> str:
    return order.model_dump_json(exclude=set(HEADER), exclude_none=True)
