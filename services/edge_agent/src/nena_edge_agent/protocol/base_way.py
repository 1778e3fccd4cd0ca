"""The way over the nodes of the base: measured once for each order message, and read at each node."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property, lru_cache
from math import dist

from nena_shared.vda5050.order import ControlPoint, Node, Trajectory
from nena_shared.vda5050.state import PlannedPath


class BaseWay:
    """Straight from node to node; what lies before a node is known by its sequenceId.

    Navigation chooses its own way between the nodes; what is planned for certain are the nodes.
    """

    def __init__(self, nodes: Iterable[Node] = ()) -> None:
        self._base = [node for node in nodes if node.released]

    def length_from(self, sequence_id: int) -> float:
        """Give the way in m from a node of the base to its end; 0 where that is not known."""
        index = self._index_of(sequence_id)
        return self._left[index] if index is not None and index < len(self._left) else 0.0

    def path(self, last: Node | None, sequence_id: int) -> PlannedPath | None:
        """Give the planned path (section 6.6.2) from ``last`` over the nodes from ``sequence_id`` on.

        None where there is none: no base is left, or a node of it has no place.
        """
        index = self._index_of(sequence_id)
        if index is None or len(self._corners) != len(self._base):
            return None
        place = last.node_position if last else None
        first = (_corner(place.x, place.y),) if place else ()
        points = (*first, *self._corners[index:])
        if len(points) <= 1:
            return None
        trajectory = Trajectory(degree=1, knot_vector=_knots(len(points)), control_points=points)
        return PlannedPath(trajectory=trajectory, traversed_nodes=self._ids[index:])

    def _index_of(self, sequence_id: int) -> int | None:
        """Give the place of a node in the base: its nodes are numbered without gaps, by twos."""
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
    def _left(self) -> list[float]:
        return _lengths(self._corners)


def _lengths(corners: tuple[ControlPoint, ...]) -> list[float]:
    """Give for each corner the way from it to the last one."""
    left = [0.0] * len(corners)
    for index in range(len(corners) - 2, -1, -1):
        here, there = corners[index], corners[index + 1]
        left[index] = left[index + 1] + dist((here.x, here.y), (there.x, there.y))
    return left


@lru_cache(maxsize=1024)
def _corner(x: float, y: float) -> ControlPoint:
    return ControlPoint(x=x, y=y)


@lru_cache(maxsize=256)
def _knots(points: int) -> tuple[float, ...]:
    """Give the knots of a curve of degree 1, which has a corner at each of its control points."""
    steps = points - 1
    return (0.0, *(index / steps for index in range(steps + 1)), 1.0)
