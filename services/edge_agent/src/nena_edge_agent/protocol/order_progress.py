"""The progress of the current order, and the history of ended orders (sections 6.1.2 and 6.6.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import lru_cache
from hashlib import sha256
from itertools import accumulate, pairwise, starmap
from math import dist
from typing import Final

from nena_shared.vda5050.base import CommandHeader, WireObject
from nena_shared.vda5050.order import ControlPoint, Edge, Node, Order, Trajectory
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import EdgeState, NodeState, PlannedPath


class BasePath:
    """The path through the nodes of the base, computed once per order message.

    ``paths`` are the trajectories and corridors to follow, by the sequenceId of the node that they lead to.
    Between other nodes navigation plans the path, so only the nodes are known.
    """

    def __init__(
        self, nodes: Iterable[Node] = (), paths: Mapping[int, tuple[Point, ...]] | None = None
    ) -> None:
        base = [node for node in nodes if node.released]
        self._ids = tuple(node.node_id for node in base)
        self._first = base[0].sequence_id if base else 0
        self._points: list[ControlPoint] = []
        self._starts: list[int] = []
        driven: list[float] = []
        last: tuple[Point, ...] = ()
        for node in base:
            place = node.node_position
            if place is None:
                break  # order acceptance refuses such an order
            path = (paths or {}).get(node.sequence_id, ((place.x, place.y),))
            self._starts.append(len(self._points))
            self._points += starmap(_control_point, path)
            driven.append(sum(starmap(dist, pairwise((*last, *path)))) if last else 0.0)
            last = ((place.x, place.y),)
        self._left = list(accumulate(reversed(driven[1:]), initial=0.0))[::-1]

    def length_from(self, sequence_id: int) -> float:
        """Return the length in m from a node of the base to its end; 0 if unknown."""
        index = self._index_of(sequence_id)
        return self._left[index] if index is not None else 0.0

    def path(self, last: Node | None, sequence_id: int) -> PlannedPath | None:
        """Return the planned path (section 6.6.2) from ``last`` through the nodes from ``sequence_id`` on.

        None if no base is left, or one of its nodes has no position.
        """
        index = self._index_of(sequence_id)
        if index is None:
            return None
        place = last.node_position if last else None
        first = (_control_point(place.x, place.y),) if place else ()
        points = (*first, *self._points[self._starts[index] :])
        if len(points) <= 1:
            return None
        # A polyline is a NURBS of degree 1 (7.3).
        trajectory = Trajectory(degree=1, knot_vector=_polyline_knots(len(points)), control_points=points)
        return PlannedPath(trajectory=trajectory, traversed_nodes=self._ids[index:])

    def _index_of(self, sequence_id: int) -> int | None:
        """Return the index of a node in the base: sequenceIds of nodes rise by 2 without gaps (7.3)."""
        # Between two nodes their edge has the number between (7.3).
        index = (sequence_id - self._first) // 2
        complete = len(self._starts) == len(self._ids)
        return index if complete and 0 <= index < len(self._ids) else None


@lru_cache(maxsize=1024)
def _control_point(x: float, y: float) -> ControlPoint:
    return ControlPoint(x=x, y=y)


@lru_cache(maxsize=256)
def _polyline_knots(points: int) -> tuple[float, ...]:
    """Return the knots of a polyline (a NURBS of degree 1) with this number of points."""
    steps = points - 1
    return (0.0, *(index / steps for index in range(steps + 1)), 1.0)


Point = tuple[float, float]
PathOf = Callable[[Edge, Node | None, Node], tuple[Point, ...]]
"""Returns the path that the robot follows along an edge between two nodes; empty: navigation plans one."""
_HEADER = frozenset(CommandHeader.model_fields)


@dataclass(frozen=True, slots=True)
class OrderFingerprints:
    """Fingerprints of the last accepted order message.

    ``whole`` is that of the message without its header, ``decision_node`` that of its last released node,
    where an update begins.
    """

    whole: str
    decision_node: str


def fingerprint(message: WireObject) -> str:
    """Return a digest of the message without its header."""
    return sha256(message.model_dump_json(exclude=set(_HEADER), exclude_none=True).encode()).hexdigest()


ENDED_ORDERS_KEPT: Final = 200
"""Maximum number of ended orders in the history; beyond it, the oldest is dropped."""

EPOCH_TOLERANCE: Final = timedelta(days=1)
"""Maximum time that an epoch may be ahead of the robot's clock."""


NO_HEADER_ID: Final = -1
"""Lower than any headerId."""


@dataclass(frozen=True, slots=True)
class OrderHeader:
    """Header values of accepted messages (section 7.2).

    ``header_id`` is the highest of orders, within the current epoch if the sender uses epochs; ``timestamp``
    is that of the last order. ``epoch`` is the highest of all commands.
    """

    header_id: int
    timestamp: datetime | None
    epoch: int | None = None


class OrderHistory:
    """Ended orders, oldest first, and the headers of accepted messages.

    Orders are stored as digests of their orderIds: digests have a fixed length, so the journal stays small.
    """

    def __init__(self, ended: Iterable[str] = (), last_header: OrderHeader | None = None) -> None:
        self._ended = dict.fromkeys(ended)
        self.last_header = last_header

    @property
    def ended(self) -> tuple[str, ...]:
        """Return digests of the ended orders, oldest first."""
        return tuple(self._ended)

    def end(self, order_id: str) -> None:
        """Store an order that is replaced by a new one; an empty ``order_id`` means there was none."""
        if not order_id:
            return
        self._ended[_order_digest(order_id)] = None
        while len(self._ended) > ENDED_ORDERS_KEPT:
            del self._ended[next(iter(self._ended))]

    def accept(self, order: Order, utc: datetime | None) -> None:
        """Store the header of an accepted order or update; ``utc`` is the robot's time, if known."""
        self.begin_epoch(order.nena_epoch, utc)
        last = self.last_header or OrderHeader(NO_HEADER_ID, None)
        # In each epoch headerIds start again.
        counts = order.nena_epoch is None or order.nena_epoch == last.epoch
        header_id = max(last.header_id, order.header_id) if counts else last.header_id
        self.last_header = OrderHeader(header_id, order.timestamp, last.epoch)

    def begin_epoch(self, epoch: int | None, utc: datetime | None) -> None:
        """Store a greater epoch, in which headerIds restart; ``utc`` is the robot's time, if known.

        An epoch is a Unix time in seconds. One far in the future is not stored: no order service could take
        over from it.
        """
        last = self.last_header or OrderHeader(NO_HEADER_ID, None)
        if epoch is not None and utc is not None and epoch > (utc + EPOCH_TOLERANCE).timestamp():
            return
        if epoch is not None and (last.epoch is None or epoch > last.epoch):
            self.last_header = OrderHeader(NO_HEADER_ID, last.timestamp, epoch)

    def outdated(self, epoch: int | None) -> str | None:
        """Return why a sender with this epoch must not command the robot any more, None if it may."""
        last = self.last_header
        if epoch is None or last is None or last.epoch is None or epoch >= last.epoch:
            return None
        return f"it is of epoch {epoch}, but an order service of epoch {last.epoch} has taken over"

    def replay(self, order: Order) -> str | None:
        """Return why a new ``order`` is a replay of an old message, None if it is not.

        Its orderId is the one of an ended order or, within an epoch, its headerId does not increase (7.2).
        Headers of other fleet controls prove nothing: counters restart, and clocks are set back.
        """
        if _order_digest(order.order_id) in self._ended:
            return f"order '{order.order_id}' was received before and has ended"
        last = self.last_header
        in_epoch = last is not None and order.nena_epoch is not None and order.nena_epoch == last.epoch
        if last is None or not in_epoch or order.header_id > last.header_id:
            return None
        new, old = _describe_header(order), _describe_header(last)
        return f"the message ({new}) is older than the last accepted order ({old})"


def _describe_header(header: OrderHeader | Order) -> str:
    time = f"{header.timestamp:%Y-%m-%dT%H:%M:%SZ}" if header.timestamp else "no time"
    return f"headerId {header.header_id}, {time}"


def _order_digest(order_id: str) -> str:
    return sha256(order_id.encode()).hexdigest()[:32]


class OrderProgress:
    """The remaining nodes and edges of the order, and the last reached node (section 6.6.2).

    Attributes:
        nodes: remaining nodes, without the one where the robot is.
        edges: remaining edges; the robot is on the first one (``edge_entered``) or enters it next.
        decision_point: nodeId and sequenceId of the last released node, where an update begins.
        content: fingerprints of the last message.
        on_last_node: the robot has not left its last node.
        cleared: the order ended early: it was cancelled (``cancelled``) or the operating mode changed.
    """

    def __init__(self, rules: Rules, path_of: PathOf | None = None) -> None:
        """Prepare; ``path_of`` returns the paths of a robot that follows them."""
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
        self.content: OrderFingerprints | None = None
        self.nodes: deque[Node] = deque()
        self.edges: deque[Edge] = deque()
        self.base_path = BasePath()
        self.node_states: tuple[NodeState, ...] = ()
        """The remaining nodes, as reported in the state."""
        self.edge_states: tuple[EdgeState, ...] = ()
        self._rules, self._path_of = rules, path_of
        self.revision = 0

    def describe_rest(self) -> None:
        """Compute what the state reports of the rest of the order; its first edge begins at the last node."""
        self.node_states = tuple(
            NodeState(
                node_id=node.node_id,
                sequence_id=node.sequence_id,
                node_descriptor=node.node_descriptor,
                released=node.released,
                node_position=node.node_position,
            )
            for node in self.nodes
        )
        self.edge_states = tuple(
            EdgeState(
                edge_id=edge.edge_id,
                sequence_id=edge.sequence_id,
                edge_descriptor=edge.edge_descriptor,
                released=edge.released,
                # A trajectory that is tolerated but not followed would be a wrong promise.
                trajectory=edge.trajectory if self._path_of is not None else None,
            )
            for edge in self.edges
        )
        paths: dict[int, tuple[Point, ...]] = {}
        start = self.last_node
        for edge, node in zip(self.edges, self.nodes, strict=False):
            if self._path_of is not None and node.released and (path := self._path_of(edge, start, node)):
                paths[node.sequence_id] = path
            start = node
        self.base_path = BasePath(self.nodes, paths)

    def begin(self, order: Order) -> None:
        """Begin a new order, with its first node as reached (section 6.6.2)."""
        self.order_id, self.order_update_id = order.order_id, order.order_update_id
        self.cancelled = self.cleared = False
        self.nodes.clear()
        self.edges.clear()
        self._append_order(order)
        # The first node counts as reached at once, so that it is in no nodeStates (6.6.2).
        self._reach_node(order.nodes[0])
        self.describe_rest()

    def extend(self, order: Order) -> None:
        """Replace the horizon by an update that begins at the decision point (section 6.1.2)."""
        self.order_update_id = order.order_update_id
        # An update may revive an order that ended early at its decision point (6.1.2).
        if self.cleared:
            self.cleared = False
            self._reach_node(order.nodes[0])
        while self.nodes and not self.nodes[-1].released:
            self.nodes.pop()
        while self.edges and not self.edges[-1].released:
            self.edges.pop()
        self._append_order(order)
        self.describe_rest()
        self.revision += 1

    @property
    def next_node(self) -> Node | None:
        """Return the node to drive to, if it is in the base."""
        return self.nodes[0] if self.nodes and self.nodes[0].released else None

    def enter_edge(self) -> Edge:
        """Enter the next edge (section 6.6.2)."""
        self.edge_entered = True
        self.revision += 1
        return self.edges[0]

    def leave_node(self) -> None:
        """Record that the robot moves away from its last node."""
        if self.on_last_node:
            self.on_last_node = False
            self.revision += 1

    def traverse(self) -> tuple[Node, Edge]:
        """Count the next node as traversed (section 6.6.2); return it, and the edge that led there."""
        node, edge = self.nodes.popleft(), self.edges.popleft()
        self.node_states, self.edge_states = self.node_states[1:], self.edge_states[1:]
        self._reach_node(node)
        return node, edge

    def clear(self, *, cancelled: bool) -> None:
        """End the order early; its IDs and the last node stay (section 6.6.7).

        A ``cancelled`` order accepts no update. Otherwise, an update may begin where the base ended.
        """
        self.nodes.clear()
        self.edges.clear()
        self.node_states, self.edge_states = (), ()
        self.edge_entered = False
        self.cancelled, self.cleared = self.cancelled or cancelled, True
        self.revision += 1

    def place_at(self, node_id: str) -> None:
        """Set the last node; if it changes, the ended order cannot be continued. Empty: no node."""
        if node_id != self.last_node_id:
            self.last_node_id, self.last_node_sequence_id, self.last_node = node_id, 0, None
            self.decision_point = None
        self.on_last_node = bool(node_id)
        self.revision += 1

    @property
    def planned_path(self) -> PlannedPath | None:
        """Return the path through the rest of the base, as reported in the state."""
        return self.base_path.path(self.last_node, self.nodes[0].sequence_id) if self.nodes else None

    def _append_order(self, order: Order) -> None:
        self.nodes.extend(order.nodes[1:])
        self.edges.extend(order.edges)
        # The decision point is the last node of the base, where an update begins (6.1.2).
        decision_node = next(node for node in reversed(order.nodes) if node.released)
        self.decision_point = decision_node.node_id, decision_node.sequence_id
        if self._rules.equal_update_id_compared or self._rules.stitching_node_repeated:
            self.content = OrderFingerprints(fingerprint(order), fingerprint(decision_node))

    def _reach_node(self, node: Node) -> None:
        self.last_node, self.last_node_id = node, node.node_id
        self.last_node_sequence_id = node.sequence_id
        self.on_last_node, self.edge_entered = True, False
        self.revision += 1
