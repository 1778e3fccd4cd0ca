"""The progress of the current order, and the history of ended orders (sections 6.1.2 and 6.6.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from datetime import datetime, timedelta
from functools import cached_property, lru_cache
from hashlib import sha256
from itertools import accumulate, chain, pairwise, starmap
from math import dist
from typing import Final, NamedTuple, Protocol

from nena_shared.vda5050.base import CommandHeader, WireObject
from nena_shared.vda5050.order import ControlPoint, Edge, Node, Order, Trajectory
from nena_shared.vda5050.state import EdgeState, NodeState, PlannedPath


class BasePath:
    """The path through the nodes of the base, computed once per order message.

    ``paths`` are the trajectories and corridors to follow, by the sequenceId of the node that they lead to.
    Between other nodes navigation plans the path, so only the nodes are known.
    """

    def __init__(
        self, nodes: Iterable[Node] = (), paths: Mapping[int, tuple[Point, ...]] | None = None
    ) -> None:
        self._base = [node for node in nodes if node.released]
        self._paths = paths or {}

    def length_from(self, sequence_id: int) -> float:
        """Return the length in m from a node of the base to its end; 0 if unknown."""
        index = self._index_of(sequence_id)
        return self._left[index] if index is not None and index < len(self._left) else 0.0

    def path(self, last: Node | None, sequence_id: int) -> PlannedPath | None:
        """Return the planned path (section 6.6.2) from ``last`` through the nodes from ``sequence_id`` on.

        None if no base is left, or one of its nodes has no position.
        """
        index = self._index_of(sequence_id)
        if index is None or len(self._corners) != len(self._base):
            return None
        place = last.node_position if last else None
        first = (_corner(place.x, place.y),) if place else ()
        points = (*first, *self._points[self._starts[index] :])
        if len(points) <= 1:
            return None
        trajectory = Trajectory(degree=1, knot_vector=_knots(len(points)), control_points=points)
        return PlannedPath(trajectory=trajectory, traversed_nodes=self._ids[index:])

    def _index_of(self, sequence_id: int) -> int | None:
        """Return the index of a node in the base: sequenceIds of nodes rise by 2 without gaps."""
        index = (sequence_id - self._base[0].sequence_id) // 2 if self._base else -1
        return index if 0 <= index < len(self._base) else None

    @cached_property
    def _ids(self) -> tuple[str, ...]:
        return tuple(node.node_id for node in self._base)

    @cached_property
    def _corners(self) -> tuple[ControlPoint, ...]:
        places = (node.node_position for node in self._base)
        return tuple(_corner(place.x, place.y) for place in places if place)

    @cached_property
    def _approaches(self) -> list[tuple[ControlPoint, ...]]:
        """Return the points that lead to each node of the base: its path, or only the node."""
        own = self._paths
        return [
            tuple(starmap(_corner, own[node.sequence_id])) if node.sequence_id in own else (corner,)
            for node, corner in zip(self._base, self._corners, strict=True)
        ]

    @cached_property
    def _points(self) -> tuple[ControlPoint, ...]:
        return tuple(chain.from_iterable(self._approaches))

    @cached_property
    def _starts(self) -> list[int]:
        """Return the index of the first point that leads to each node."""
        return [0, *accumulate(map(len, self._approaches))]

    @cached_property
    def _left(self) -> list[float]:
        """Return the length from each corner to the last one, m."""
        corners, left = self._corners, [0.0] * len(self._corners)
        for index in range(len(corners) - 2, -1, -1):
            here, there = corners[index], corners[index + 1]
            path = self._paths.get(self._base[index + 1].sequence_id, ((there.x, there.y),))
            left[index] = left[index + 1] + sum(starmap(dist, pairwise(((here.x, here.y), *path))))
        return left


@lru_cache(maxsize=1024)
def _corner(x: float, y: float) -> ControlPoint:
    return ControlPoint(x=x, y=y)


@lru_cache(maxsize=256)
def _knots(points: int) -> tuple[float, ...]:
    """Return the knots of a polyline (a NURBS of degree 1) with this number of points."""
    steps = points - 1
    return (0.0, *(index / steps for index in range(steps + 1)), 1.0)


Point = tuple[float, float]
PathOf = Callable[[Edge, Node | None, Node], tuple[Point, ...]]
"""Returns the path that the robot follows along an edge between two nodes; empty: navigation plans one."""
_HEADER = frozenset(CommandHeader.model_fields)


class OrderFingerprints(Protocol):
    """Fingerprints of the last accepted order message."""

    @property
    def whole(self) -> str:
        """Return the fingerprint of the message without its header."""
        ...

    @property
    def decision_node(self) -> str:
        """Return the fingerprint of its last released node, where an update begins."""
        ...


class LazyFingerprints:
    """Fingerprints of a message, computed on demand because most orders are never repeated."""

    def __init__(self, order: Order) -> None:
        self._order = order

    @cached_property
    def whole(self) -> str:
        """Return the fingerprint of the message without its header."""
        return fingerprint(self._order)

    @cached_property
    def decision_node(self) -> str:
        """Return the fingerprint of its last released node."""
        return fingerprint(next(node for node in reversed(self._order.nodes) if node.released))


def fingerprint(message: WireObject) -> str:
    """Return a digest of the message without its header."""
    return sha256(message.model_dump_json(exclude=set(_HEADER), exclude_none=True).encode()).hexdigest()


ENDED_ORDERS_KEPT: Final = 200
"""Maximum number of ended orders in the history; beyond it, the oldest is dropped."""
CLOCK_TOLERANCE: Final = timedelta(seconds=60)
"""Tolerated difference between the clocks of two fleet controls, or of fleet control and robot."""

EPOCH_TOLERANCE: Final = timedelta(days=1)
"""Maximum time that an epoch may be ahead of the robot's clock."""


NO_HEADER_ID: Final = -1
"""Lower than any headerId."""


class OrderHeader(NamedTuple):
    """The highest header values of accepted messages (section 7.2).

    ``header_id`` and ``timestamp`` are those of orders; ``header_id`` counts within the current epoch if the
    sender uses epochs. ``epoch`` is the highest of all commands.
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
        self._ended[_digest(order_id)] = None
        while len(self._ended) > ENDED_ORDERS_KEPT:
            del self._ended[next(iter(self._ended))]

    def accept(self, order: Order, utc: datetime | None) -> None:
        """Store the header of an accepted order or update; ``utc`` is the robot's time, if known.

        A timestamp in the future is not stored: once the sender's clock is corrected, every new order would
        look old.
        """
        self.begin_epoch(order.nena_epoch, utc)
        last = self.last_header or OrderHeader(NO_HEADER_ID, None)
        credible = utc is None or order.timestamp <= utc + CLOCK_TOLERANCE
        times = [each for each in (last.timestamp, order.timestamp if credible else None) if each]
        counts = order.nena_epoch is None or order.nena_epoch == last.epoch
        header_id = max(last.header_id, order.header_id) if counts else last.header_id
        self.last_header = OrderHeader(header_id, max(times, default=None), last.epoch)

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

    def replay(self, order: Order, *, dated: bool) -> str | None:
        """Return why a new ``order`` is a replay of an old message, None if it is not (section 7.2).

        Within an epoch, headerIds increase. Without epochs, the sender's counter may restart or its clock may
        be set back, so a replay is a message with both a lower headerId and an older timestamp. If the
        timestamp is unreadable (``dated`` False), the headerId decides, unless the last sender used epochs.
        """
        if _digest(order.order_id) in self._ended:
            return f"order '{order.order_id}' was received before and has ended"
        last = self.last_header
        if last is None or not self._is_older(order, last, dated=dated):
            return None
        return f"the message ({_describe(order)}) is older than the last accepted order ({_describe(last)})"

    def _is_older(self, order: Order, last: OrderHeader, *, dated: bool) -> bool:
        if order.nena_epoch is not None:
            return order.nena_epoch == last.epoch and order.header_id <= last.header_id
        if not dated:
            return last.epoch is None and order.header_id < last.header_id
        if last.epoch is None and order.header_id > last.header_id:
            return False
        return last.timestamp is not None and order.timestamp < last.timestamp - CLOCK_TOLERANCE


def _describe(header: OrderHeader | Order) -> str:
    time = f"{header.timestamp:%Y-%m-%dT%H:%M:%SZ}" if header.timestamp else "no time"
    return f"headerId {header.header_id}, {time}"


def _digest(order_id: str) -> str:
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
        self.content: OrderFingerprints | None = None
        self.nodes: deque[Node] = deque()
        self.edges: deque[Edge] = deque()
        self.base_path = BasePath()
        self._path_of: PathOf | None = None
        self.revision = 0
        self._node_states: dict[int, NodeState] = {}
        self._edge_states: dict[int, EdgeState] = {}

    def follow_paths(self, path_of: PathOf) -> None:
        """Set the function that returns the path along an edge, and recompute the base's path."""
        self._path_of = path_of
        self._measure()

    def _measure(self) -> None:
        """Compute the path through the base; the first edge begins at the last node."""
        paths: dict[int, tuple[Point, ...]] = {}
        before = self.last_node
        for edge, node in zip(self.edges, self.nodes, strict=False):
            if self._path_of is not None and node.released and (path := self._path_of(edge, before, node)):
                paths[node.sequence_id] = path
            before = node
        self.base_path = BasePath(self.nodes, paths)

    def begin(self, order: Order) -> None:
        """Begin a new order, with its first node as reached (section 6.6.2)."""
        self.order_id, self.order_update_id = order.order_id, order.order_update_id
        self.cancelled = self.cleared = False
        self.nodes.clear()
        self.edges.clear()
        self._append(order)
        self._reach(order.nodes[0])
        self._measure()

    def extend(self, order: Order) -> None:
        """Replace the horizon by an update that begins at the decision point (section 6.1.2)."""
        self.order_update_id = order.order_update_id
        if self.cleared:
            self.cleared = False
            self._reach(order.nodes[0])
        while self.nodes and not self.nodes[-1].released:
            self.nodes.pop()
        while self.edges and not self.edges[-1].released:
            self.edges.pop()
        self._append(order)
        self._measure()
        self.revision += 1

    @property
    def next_node(self) -> Node | None:
        """Return the node to drive to, if it is in the base."""
        return self.nodes[0] if self.nodes and self.nodes[0].released else None

    @property
    def horizon_left(self) -> bool:
        """Return whether the order has a horizon."""
        return bool(self.nodes) and not self.nodes[-1].released

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
        self._reach(node)
        return node, edge

    def clear(self, *, cancelled: bool) -> None:
        """End the order early; its IDs and the last node stay (section 6.6.7).

        A ``cancelled`` order accepts no update. Otherwise, an update may begin where the base ended.
        """
        self.nodes.clear()
        self.edges.clear()
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
    def node_states(self) -> tuple[NodeState, ...]:
        """Return the remaining nodes, as reported in the state."""
        states = self._node_states
        return tuple(states.get(node.sequence_id) or self._cached_node_state(node) for node in self.nodes)

    @property
    def edge_states(self) -> tuple[EdgeState, ...]:
        """Return the remaining edges, as reported in the state."""
        states = self._edge_states
        return tuple(states.get(edge.sequence_id) or self._cached_edge_state(edge) for edge in self.edges)

    @property
    def planned_path(self) -> PlannedPath | None:
        """Return the path through the rest of the base, as reported in the state."""
        return self.base_path.path(self.last_node, self.nodes[0].sequence_id) if self.nodes else None

    def _cached_node_state(self, node: Node) -> NodeState:
        self._node_states[node.sequence_id] = shown = _node_state(node)
        return shown

    def _cached_edge_state(self, edge: Edge) -> EdgeState:
        trajectory = edge.trajectory if self._path_of is not None else None
        self._edge_states[edge.sequence_id] = shown = _edge_state(edge, trajectory)
        return shown

    def _append(self, order: Order) -> None:
        self._node_states.clear()
        self._edge_states.clear()
        self.nodes.extend(order.nodes[1:])
        self.edges.extend(order.edges)
        self.decision_point = _decision_point(order.nodes)
        self.content = LazyFingerprints(order)

    def _reach(self, node: Node) -> None:
        self.last_node, self.last_node_id = node, node.node_id
        self.last_node_sequence_id = node.sequence_id
        self.on_last_node, self.edge_entered = True, False
        self.revision += 1


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


def _edge_state(edge: Edge, trajectory: Trajectory | None) -> EdgeState:
    return EdgeState(
        edge_id=edge.edge_id,
        sequence_id=edge.sequence_id,
        edge_descriptor=edge.edge_descriptor,
        released=edge.released,
        trajectory=trajectory,
    )
