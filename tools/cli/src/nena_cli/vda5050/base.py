"""An order as fleet control has sent it so far, over all its updates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.order import Edge, Node, Order

OrderKey = tuple[str, int]
"""orderId and orderUpdateId."""


@dataclass(frozen=True, slots=True)
class SentOrder:
    """The base so far, by sequenceId, and the last update with its horizon."""

    last: Order
    nodes: dict[int, Node]
    """Released ones."""
    actions: dict[str, Action]
    """Those of the base, and of the horizon of the last update."""
    complete: bool
    """Whether the order was seen from its beginning."""

    @property
    def key(self) -> OrderKey:
        """What names the last update."""
        return self.last.order_id, self.last.order_update_id

    @property
    def decision_point(self) -> Node:
        """The last released node."""
        return self.nodes[max(self.nodes)]

    @property
    def end(self) -> int:
        """The sequenceId of the last node, horizon and all."""
        return self.last.nodes[-1].sequence_id

    def released(self) -> dict[int, tuple[str, bool]]:
        """Give nodeId and released of each node, by sequenceId."""
        base = {number: (node.node_id, True) for number, node in self.nodes.items()}
        return base | {node.sequence_id: (node.node_id, node.released) for node in self.last.nodes}


def extended(before: SentOrder | None, order: Order) -> SentOrder:
    """Give the order with what an update adds to it; with another order all begins anew."""
    nodes = {node.sequence_id: node for node in order.nodes if node.released}
    actions = {action.action_id: action for action in actions_of(order)}
    complete = order.nodes[0].sequence_id == 0
    if before and before.last.order_id == order.order_id:
        horizon = {action.action_id for action in _horizon_actions(before.last)}
        kept = {name: action for name, action in before.actions.items() if name not in horizon}
        nodes, actions, complete = before.nodes | nodes, kept | actions, before.complete
    return SentOrder(order, nodes, actions, complete)


def _horizon_actions(order: Order) -> Iterator[Action]:
    parts: Iterator[Node | Edge] = chain(order.nodes, order.edges)
    return chain.from_iterable(part.actions for part in parts if not part.released)


def actions_of(order: Order) -> Iterator[Action]:
    """Give all actions of an order message, nodes first."""
    yield from chain.from_iterable(node.actions for node in order.nodes)
    yield from chain.from_iterable(edge.actions for edge in order.edges)
