"""The planned path of the state (section 6.6.2): straight from node to node of the base."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

from nena_shared.vda5050.order import ControlPoint, Node, Trajectory
from nena_shared.vda5050.state import PlannedPath


def planned_path(last: Node | None, ahead: Iterable[Node]) -> PlannedPath | None:
    """Give the path from the node reached last over the released nodes ``ahead``, None where there is none.

    Navigation chooses its own way between the nodes; what is planned for certain are the nodes. A curve of
    degree 1 has a corner at each of its control points.
    """
    base = [node for node in ahead if node.released]
    places = [node.node_position for node in (last, *base) if node and node.node_position]
    if not base or len(places) <= 1:
        return None
    points = tuple(_corner(place.x, place.y) for place in places)
    trajectory = Trajectory(degree=1, knot_vector=_knots(len(points)), control_points=points)
    return PlannedPath(trajectory=trajectory, traversed_nodes=tuple(node.node_id for node in base))


@lru_cache(maxsize=1024)
def _corner(x: float, y: float) -> ControlPoint:
    return ControlPoint(x=x, y=y)


@lru_cache(maxsize=256)
def _knots(points: int) -> tuple[float, ...]:
    steps = points - 1
    return (0.0, *(index / steps for index in range(steps + 1)), 1.0)
