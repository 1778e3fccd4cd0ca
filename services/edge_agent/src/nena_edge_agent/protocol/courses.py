"""Paths of edges: trajectories, and the centre lines of corridors (sections 6.1.5 and 7.3).

Coordinates are in metres in the plant's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from math import atan2, ceil, copysign, dist, hypot, inf
from typing import NamedTuple

from pydantic import ValidationError

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.geometry import Footprint, Point
from nena_shared.plant import curve
from nena_shared.plant.track import PathTrajectory, TrajectoryPoint
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.order import Corridor, CorridorReferencePoint, Edge, Node, NodePosition, Trajectory
from nena_shared.vda5050.v2_1.order import DEFAULT_DEGREE, uniform_knots

STEP = 0.1
"""Maximum distance between two points of a path, metres."""
ENDS_WITHIN = 0.1
"""Maximum distance of a trajectory's ends from its nodes, metres."""
LONGEST = 1000.0
"""Maximum length of one path, metres."""
MOST_POINTS = 10_000
"""Maximum number of control points times the degree squared: the cost of evaluating a trajectory."""
DETOUR = 0.5
"""Length beyond navigation's goal tolerance from which a loop back to a path's end is refused, metres."""
DEFAULT_TOLERANCE = 0.5
"""Goal tolerance to assume until navigation reports its own, metres."""
CORNER = 0.02
"""Maximum deviation of a simplified path, metres."""
OFF_TRAJECTORY = 0.5
"""Allowed distance from a trajectory without a corridor, metres; controllers cut bends."""


class Fault(NamedTuple):
    """Why an edge cannot be driven, and what to do about it."""

    kind: ErrorType
    text: str
    hint: str


class _NoCurveError(Exception):
    """The trajectory is invalid; the text continues "its trajectory ..."."""


def follows(edge: Edge, capabilities: Capabilities) -> bool:
    """Return whether the robot follows the trajectory or corridor of ``edge``."""
    return capabilities.follows_paths and (edge.trajectory is not None or edge.corridor is not None)


def fault(
    edge: Edge,
    start: NodePosition | None,
    end: NodePosition | None,
    footprint: Footprint,
    tolerance: float | None = None,
) -> Fault | None:
    """Return why the robot cannot follow ``edge`` from ``start`` to ``end``, None if it can.

    ``tolerance`` is navigation's goal tolerance, m; None: unknown.
    """
    if end is None:
        return None  # refused by another check
    found = (
        _straight_fault(start, end) if edge.trajectory is None else _curve_fault(edge.trajectory, start, end)
    )
    corridor = edge.corridor
    if found is None and edge.trajectory is not None:
        found = _return_fault(course(edge, start, end), tolerance or DEFAULT_TOLERANCE)
    if found or corridor is None or corridor.release_required:
        return found
    if _stays_inside(course(edge, start, end), corridor, footprint):
        return None
    text = f"the corridor of edge '{edge.edge_id}' is too narrow for the robot"
    return Fault(ErrorType.NO_ROUTE_TO_TARGET, text, "widen the corridor, or send the robot on another route")


def _straight_fault(start: NodePosition | None, end: NodePosition) -> Fault | None:
    if start is None:
        text = "the edge has a corridor without a trajectory, and its start node has no nodePosition"
        return Fault(ErrorType.VALIDATION_FAILURE, text, "send nodePosition with every node")
    return _length_fault(dist((start.x, start.y), (end.x, end.y)))


def _length_fault(length: float) -> Fault | None:
    if length <= LONGEST:
        return None
    text = f"its path is {length:.0f} m long, the robot follows {LONGEST:g} m at most"
    return Fault(ErrorType.INSUFFICIENT_MEMORY, text, "divide the edge with another node")


def _curve_fault(trajectory: Trajectory, start: NodePosition | None, end: NodePosition) -> Fault | None:
    try:
        drawn = _curve(trajectory)
    except _NoCurveError as problem:
        text = f"its trajectory {problem}"
        return Fault(
            ErrorType.VALIDATION_FAILURE, text, "send knots, degree and control points of a clamped NURBS"
        )
    points = drawn.control_points
    if len(points) * drawn.degree**2 > MOST_POINTS:
        text = f"its trajectory has {len(points)} control points of degree {drawn.degree}"
        return Fault(ErrorType.INSUFFICIENT_MEMORY, text, "divide the edge, or send fewer control points")
    first, last = curve.places(drawn, 1)
    for place, node, which in ((first, start, "start"), (last, end, "end")):
        if node is not None and (off := dist(place, (node.x, node.y))) > ENDS_WITHIN:
            text = f"its trajectory {which}s {off:.2f} m from its node"
            hint = f"make the trajectory {which} within {ENDS_WITHIN:g} m of the node"
            return Fault(ErrorType.VALIDATION_FAILURE, text, hint)
    # a curve is never longer than the straight lines between its control points
    return _length_fault(sum(hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(points)))


def _return_fault(path: Sequence[Point], tolerance: float) -> Fault | None:
    """Refuse a path that passes its own end: a controller finishes as soon as the robot is near it."""
    left = 0.0
    for after, before in pairwise(reversed(path)):
        left += dist(before, after)
        away = dist(before, path[-1])
        if away <= tolerance and left > tolerance + DETOUR:
            text = f"its trajectory passes {away:.2f} m from its end, {left:.1f} m before it ends"
            return Fault(ErrorType.UNSUPPORTED_PARAMETER, text, "divide the edge with a node halfway")
    return None


def _curve(trajectory: Trajectory) -> PathTrajectory:
    """Return the trajectory with its defaults filled in.

    Raises:
        _NoCurveError: it is invalid.

    """
    points, degree = trajectory.control_points, trajectory.degree or DEFAULT_DEGREE
    knots = trajectory.knot_vector
    if knots is None and len(points) > degree:
        knots = uniform_knots(len(points), degree)
    try:
        drawn = PathTrajectory(
            degree=degree,
            knot_vector=knots or (),
            control_points=tuple(
                TrajectoryPoint(x=each.x, y=each.y, weight=1.0 if each.weight is None else each.weight)
                for each in points
            ),
        )
    except ValidationError as error:
        first = error.errors()[0]
        message = f"has an invalid {first['loc'][-1]}: {first['msg']}"
        raise _NoCurveError(message) from None
    if problem := curve.fault(drawn):
        raise _NoCurveError(problem)
    if curve.has_gap(drawn):
        message = "has a gap: a knot is repeated more often than the degree"
        raise _NoCurveError(message)
    return drawn


def course(edge: Edge, start: NodePosition | None, end: NodePosition) -> tuple[Point, ...]:
    """Return the path of an edge: points at most ``STEP`` m apart, the last one at the node.

    Empty for an invalid edge, which an order from before a change of the settings may have.
    """
    begin = (start.x, start.y) if start and edge.trajectory is None else None
    return _course(edge.trajectory, begin, (end.x, end.y))


def shown(edge: Edge, start: Node | None, end: Node, capabilities: Capabilities) -> tuple[Point, ...]:
    """Return the corners of the edge's path after its start, for plannedPath in the state (section 6.6.2)."""
    position = end.node_position
    if position is None or not follows(edge, capabilities):
        return ()
    path = course(edge, start.node_position if start else None, position)
    return corners(path)[1:] if path else ()


@lru_cache(maxsize=256)
def _course(trajectory: Trajectory | None, start: Point | None, end: Point) -> tuple[Point, ...]:
    if trajectory is not None:
        try:
            return (*curve.steps(_curve(trajectory), STEP)[:-1], end)
        except _NoCurveError:
            return ()
    if start is None:
        return ()
    parts = max(1, ceil(dist(start, end) / STEP))
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    return (*((x + dx * i / parts, y + dy * i / parts) for i in range(parts)), end)


def rest(path: Sequence[Point], place: Point) -> tuple[Point, ...]:
    """Return the part of a path from ``place`` on; where the path crosses itself, the longer part."""
    away = [dist(each, place) for each in path]
    limit = min(away) + STEP / 2
    index = next(index for index, each in enumerate(away) if each <= limit)
    return tuple(path[min(index, max(0, len(path) - 2)) :])


def beginning(path: Sequence[Point], length: float) -> tuple[Point, ...]:
    """Return the beginning of a path, at least ``length`` m long."""
    kept = list(path[:1])
    for before, after in pairwise(path):
        length -= dist(before, after)
        kept.append(after)
        if length <= 0:
            break
    return tuple(kept)


def poses(path: Sequence[Point], map_id: str, theta: float | None = None) -> tuple[Pose, ...]:
    """Return the path's points with the heading of travel; the last one with ``theta``, rad, if given."""
    headings = [atan2(b[1] - a[1], b[0] - a[0]) for a, b in pairwise(path)] or [0.0]
    headings.append(headings[-1] if theta is None else theta)
    return tuple(Pose(x, y, heading, map_id) for (x, y), heading in zip(path, headings, strict=False))


@lru_cache(maxsize=256)
def corners(path: tuple[Point, ...]) -> tuple[Point, ...]:
    """Return the corners of a polyline that deviates from ``path`` by at most ``CORNER`` m."""
    kept, waiting = {0, len(path) - 1}, [(0, len(path) - 1)]
    while waiting:
        first, last = waiting.pop()
        line = (path[first], path[last])
        away = [(_apart(path[index], *line), index) for index in range(first + 1, last)]
        farthest, index = max(away, default=(0.0, 0))
        if farthest > CORNER:
            kept.add(index)
            waiting += [(first, index), (index, last)]
    return tuple(path[index] for index in sorted(kept))


def _apart(place: Point, start: Point, end: Point) -> float:
    return abs(_beside(place, start, end, 0.0, 1.0))


def offset(path: Sequence[Point], place: Point) -> float:
    """Return the signed distance (m, positive to the left) from a path that is extended at both ends."""
    last = len(path) - 2
    found = (
        _beside(place, a, b, -inf if index == 0 else 0.0, inf if index == last else 1.0)
        for index, (a, b) in enumerate(pairwise(path))
    )
    return min(found, key=abs, default=0.0)


def _beside(place: Point, start: Point, end: Point, least: float, most: float) -> float:
    """Return the signed distance from the part of a line between ``least`` and ``most``; positive: left."""
    along, across = (end[0] - start[0], end[1] - start[1]), (place[0] - start[0], place[1] - start[1])
    square = along[0] ** 2 + along[1] ** 2
    share = 0.0
    if square > 0:
        share = max(least, min(most, (across[0] * along[0] + across[1] * along[1]) / square))
    away = hypot(across[0] - share * along[0], across[1] - share * along[1])
    return copysign(away, along[0] * across[1] - along[1] * across[0])


def leaves(path: Sequence[Point], corridor: Corridor | None, pose: Pose, footprint: Footprint) -> float:
    """Return by how many metres a robot at ``pose`` exceeds its allowed distance from ``path``; 0: inside.

    A corridor with releaseRequired is not used: the robot stays on the trajectory.
    """
    widths = (OFF_TRAJECTORY, OFF_TRAJECTORY)
    places: Sequence[Point] = ((pose.x, pose.y),)
    if corridor is not None and not corridor.release_required:
        widths = (corridor.left_width, corridor.right_width)
        if corridor.corridor_reference_point is CorridorReferencePoint.CONTOUR:
            places = footprint.at(pose)[0]
    offsets = [offset(path, each) for each in places]
    return max(0.0, max(offsets) - widths[0], -min(offsets) - widths[1])


def _stays_inside(path: tuple[Point, ...], corridor: Corridor, footprint: Footprint) -> bool:
    """Return whether a robot on ``path`` stays in its corridor, with its contour if required."""
    ways = corners(path)
    on_the_way = [pose for a, b in pairwise(ways) for pose in poses((a, b), "")]
    return all(leaves(ways, corridor, pose, footprint) <= CORNER for pose in on_the_way)
