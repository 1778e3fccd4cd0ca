"""How much of its order a robot has driven."""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.vda5050.brief.state import StateBrief


@dataclass(slots=True)
class OrderProgress:
    """Nodes left against the nodes of the order.

    Nodes have the even sequence ids and the first one counts as reached (VDA 5050 3.0 sections 6.1.1 and
    6.6.1), so the last node's sequence id tells how many there are, also to an aggregator that was started in
    mid-order, and also after the horizon was replaced or the base was extended.
    """

    order_id: str = ""
    nodes: int = 0
    """Nodes to reach in the whole order, without the first."""
    nodes_left: int = 0

    def follow(self, state: StateBrief) -> None:
        """Take in a state."""
        if state.order_id != self.order_id:
            self.order_id = state.order_id
            self.nodes = 0
        if state.node_states:
            self.nodes = state.node_states[-1].sequence_id // 2
            self.nodes_left = min(len(state.node_states), self.nodes)
        else:
            # Reached, or cancelled on the way: then the last node tells how far it came.
            reached = state.last_node_sequence_id // 2
            self.nodes = max(self.nodes, reached)
            self.nodes_left = self.nodes - reached

    @property
    def percent(self) -> float:
        """0 to 100; an order of a single node has nothing to drive and is at 100."""
        if not self.nodes:
            return 100.0
        return round(100.0 * (self.nodes - self.nodes_left) / self.nodes, 1)
