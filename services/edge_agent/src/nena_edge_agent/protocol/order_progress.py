"""The order that a robot holds, and how far it has been driven (sections 6.1.2 and 6.6.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from nena_edge_agent.protocol.base_way import BaseWay
from nena_edge_agent.protocol.memory import ProgressMemory
from nena_edge_agent.protocol.order_content import HeldContent, OrderContent
from nena_shared.vda5050.order import Edge, Node, Order
from nena_shared.vda5050.state import EdgeState, NodeState, PlannedPath


class Ahead(NamedTuple):
    """The rest of the order, as the state message shows it."""

    node_states: tuple[NodeState, ...]
    edge_states: tuple[EdgeState, ...]
    planned_path: PlannedPath | None


class OrderProgress:
    """Nodes and edges that are still to be driven, and the node reached last.

    ``nodes`` never holds the node where the robot stands. ``edges`` begins with the edge that the robot is on
    (``edge_entered``) or will enter next. ``decision_point`` is the last released node, as nodeId and
    sequenceId: there the base ends and an update begins. ``content`` is what the last message said.
    ``on_last_node``: the robot has not left it.
    ``cleared``: the order was ended before its end, by a cancel (``cancelled``) or a change of the mode.
    """

    def __init__(self) -> None:
        self.order_id = ""
        self.order_update_id = 0
        self.last_node: Node | None = None
        self.last_node_id = ""
        self.last_node_sequence_id = 0
        self.on_last_node = False
        self.edge_entered = False
        self.cancelled = False
        self.cleared = False
        self.decision_point: tuple[str, int] | None = None
        self.content: HeldContent | None = None
        self.nodes: deque[Node] = deque()
        self.edges: deque[Edge] = deque()
        self.base_way = BaseWay()
        self.revision = 0
        self._ahead: Ahead | None = None
        self._node_states: dict[int, NodeState] = {}
        self._edge_states: dict[int, EdgeState] = {}

    @classmethod
    def restored(cls, memory: ProgressMemory) -> OrderProgress:
        """Make the progress that ``memory`` tells of."""
        progress = cls()
        for name in ProgressMemory.model_fields:
            setattr(progress, name, getattr(memory, name))
        progress.nodes, progress.edges = deque(memory.nodes), deque(memory.edges)
        progress.base_way = BaseWay(memory.nodes)
        return progress

    def begin(self, order: Order) -> None:
        """Take a new order; its first node counts as reached."""
        self.order_id, self.order_update_id = order.order_id, order.order_update_id
        self.cancelled = self.cleared = False
        self.nodes.clear()
        self.edges.clear()
        self._append(order)
        self._reach(order.nodes[0])

    def extend(self, order: Order) -> None:
        """Take an update that begins at the decision point: a new way in place of the old horizon."""
        self.order_update_id = order.order_update_id
        if self.cleared:
            self.cleared = False
            self._reach(order.nodes[0])
        while self.nodes and not self.nodes[-1].released:
            self.nodes.pop()
        while self.edges and not self.edges[-1].released:
            self.edges.pop()
        self._append(order)
        self._changed()

    @property
    def next_node(self) -> Node | None:
        """The node to drive to, if it is in the base."""
        return self.nodes[0] if self.nodes and self.nodes[0].released else None

    @property
    def horizon_left(self) -> bool:
        """Whether something is still to be released."""
        return bool(self.nodes) and not self.nodes[-1].released

    def enter_edge(self) -> Edge:
        """Begin the next edge."""
        self.edge_entered = True
        self.revision += 1
        return self.edges[0]

    def leave_node(self) -> None:
        """Note that the robot moves away from its last node."""
        if self.on_last_node:
            self.on_last_node = False
            self.revision += 1

    def traverse(self) -> tuple[Node, Edge]:
        """Count the next node as traversed; gives it, and the edge that led there."""
        node, edge = self.nodes.popleft(), self.edges.popleft()
        before = self._ahead
        self._reach(node)
        if before:
            self._ahead = Ahead(before.node_states[1:], before.edge_states[1:], self._planned_path())
        return node, edge

    def clear(self, *, cancelled: bool) -> None:
        """End the order before its end; ids and the last node stay.

        One that was ``cancelled`` takes no update; else one may follow where the base ended.
        """
        self.nodes.clear()
        self.edges.clear()
        self.edge_entered = False
        self.cancelled, self.cleared = self.cancelled or cancelled, True
        self._changed()

    def place_at(self, node_id: str) -> None:
        """Note that the robot was told to be on ``node_id``; on another one the ended order has no way on."""
        if node_id != self.last_node_id:
            self.last_node_id, self.last_node_sequence_id, self.last_node = node_id, 0, None
            self.decision_point = None
        self.on_last_node = bool(node_id)
        self._changed()

    @property
    def ahead(self) -> Ahead:
        """What the state message shows of the rest of the order."""
        if self._ahead is None:
            nodes, edges = self._node_states, self._edge_states
            self._ahead = Ahead(
                tuple(nodes.get(node.sequence_id) or self._show_node(node) for node in self.nodes),
                tuple(edges.get(edge.sequence_id) or self._show_edge(edge) for edge in self.edges),
                self._planned_path(),
            )
        return self._ahead

    def _show_node(self, node: Node) -> NodeState:
        self._node_states[node.sequence_id] = shown = _node_state(node)
        return shown

    def _show_edge(self, edge: Edge) -> EdgeState:
        self._edge_states[edge.sequence_id] = shown = _edge_state(edge)
        return shown

    def _planned_path(self) -> PlannedPath | None:
        return self.base_way.path(self.last_node, self.nodes[0].sequence_id) if self.nodes else None

    def _append(self, order: Order) -> None:
        self._node_states.clear()
        self._edge_states.clear()
        self.nodes.extend(order.nodes[1:])
        self.edges.extend(order.edges)
        self.base_way = BaseWay(self.nodes)
        self.decision_point = _decision_point(order.nodes)
        self.content = OrderContent(order)

    def _reach(self, node: Node) -> None:
        self.last_node, self.last_node_id = node, node.node_id
        self.last_node_sequence_id = node.sequence_id
        self.on_last_node, self.edge_entered = True, False
        self._changed()

    def _changed(self) -> None:
        self.revision += 1
        self._ahead = None


def _decision_point(nodes: Iterable[Node]) -> tuple[str, int]:
    return next((node.node_id, node.sequence_id) for node in reversed(tuple(nodes)) if node.released)


def _node_state(node: Node) -> NodeState:
    return NodeState(
        node_id=node.node_id,
        sequence_id=node.sequence_id,
        node_descriptor=node.node_descriptor,
        released=node.released,
        node_position=node.node_position,
    )


def _edge_state(edge: Edge) -> EdgeState:
    return EdgeState(
        edge_id=edge.edge_id,
        sequence_id=edge.sequence_id,
        edge_descriptor=edge.edge_descriptor,
        released=edge.released,
    )
