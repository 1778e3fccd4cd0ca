"""Paths along edges: trajectories and the centre lines of corridors (sections 6.1.5 and 7.3).

Coordinates are in metres in the plant's frame. The first functions need only an edge and its nodes; the last
ones follow the order of a robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import islice, pairwise
from math import atan2, ceil, copysign, dist, hypot, inf
from typing import NamedTuple

from pydantic import ValidationError

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.geometry import Footprint, Point, is_within_deviation
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.plant import curve
from nena_shared.plant.track import PathTrajectory, TrajectoryPoint
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.order import Corridor, CorridorReferencePoint, Edge, Node, NodePosition, Trajectory
from nena_shared.vda5050.v2_1.order import DEFAULT_DEGREE, uniform_knots

STEP = 0.1
"""Maximum distance between two points of a path, metres."""
END_TOLERANCE = 0.1
"""Maximum distance of a trajectory's ends from its nodes, metres."""
MAXIMUM_LENGTH = 1000.0
"""Maximum length of one path, metres."""
MAXIMUM_COST = 10_000
"""Maximum cost of evaluating a trajectory: the number of control points times the degree squared."""
DETOUR = 0.5
"""Length beyond navigation's goal tolerance above which a loop back to a path's end is refused, metres."""
DEFAULT_TOLERANCE = 0.5
"""Goal tolerance until navigation reports its own, metres."""
CORNER_TOLERANCE = 0.02
"""Maximum deviation of a simplified path, metres."""
TRAJECTORY_TOLERANCE = 0.5
"""Allowed distance from a trajectory without a corridor, metres; controllers cut bends."""


class Fault(NamedTuple):
    """The reason why an edge cannot be driven, and what to do about it."""

    kind: ErrorType
    text: str
    hint: str


class _InvalidTrajectoryError(Exception):
    """The trajectory is invalid; the text continues "its trajectory ..."."""


def follows(edge: Edge, capabilities: Capabilities) -> bool:
    """Return whether the robot follows the trajectory or corridor of ``edge``."""
    return capabilities.follows_paths and (edge.trajectory is not None or edge.corridor is not None)


def edge_fault(
    edge: Edge,
    start: NodePosition | None,
    end: NodePosition | None,
    footprint: Footprint,
    tolerance: float | None = None,
) -> Fault | None:
    """Return why the robot cannot follow ``edge`` from ``start`` to ``end``, None if it can (section 6.1.4).

    ``tolerance`` is navigation's goal tolerance, m; None: unknown.
    """
    if end is None:
        return None  # another check refuses the order
    problem: Fault | None
    if edge.trajectory is not None:
        problem = _trajectory_fault(edge.trajectory, start, end)
    elif start is None:
        text = "the edge has a corridor without a trajectory, and its start node has no nodePosition"
        problem = Fault(ErrorType.VALIDATION_FAILURE, text, "send nodePosition with every node")
    else:
        problem = _length_fault(dist((start.x, start.y), (end.x, end.y)))
    if problem:
        return problem  # before the path is computed: it may be huge
    path = path_between(edge, start, end)
    # Controllers finish as soon as the robot is near the end, and so would skip a loop back to it.
    left, near = 0.0, tolerance or DEFAULT_TOLERANCE
    for farther, before in pairwise(path[::-1] if edge.trajectory else ()):
        left += dist(before, farther)
        away = dist(before, path[-1])
        if away <= near and left > near + DETOUR:
            text = f"its trajectory passes {away:.2f} m from its end, {left:.1f} m before it ends"
            return Fault(ErrorType.UNSUPPORTED_PARAMETER, text, "divide the edge with a node halfway")
    corridor = edge.corridor
    # A corridor with releaseRequired is not used: the robot stays on the trajectory.
    if corridor is None or corridor.release_required:
        return None
    line = corners(path)
    poses_on_line = [pose for a, b in pairwise(line) for pose in poses((a, b), "")]
    if all(metres_outside(line, corridor, pose, footprint) <= CORNER_TOLERANCE for pose in poses_on_line):
        return None
    text = f"the corridor of edge '{edge.edge_id}' is too narrow for the robot"
    return Fault(ErrorType.NO_ROUTE_TO_TARGET, text, "widen the corridor, or send the robot on another route")


def _length_fault(length: float) -> Fault | None:
    if length <= MAXIMUM_LENGTH:
        return None
    text = f"its path is {length:.0f} m long, the robot follows {MAXIMUM_LENGTH:g} m at most"
    return Fault(ErrorType.INSUFFICIENT_MEMORY, text, "divide the edge with another node")


def _trajectory_fault(trajectory: Trajectory, start: NodePosition | None, end: NodePosition) -> Fault | None:
    try:
        spline = _spline_of(trajectory)
    except _InvalidTrajectoryError as problem:
        text = f"its trajectory {problem}"
        return Fault(
            ErrorType.VALIDATION_FAILURE, text, "send knots, degree and control points of a clamped NURBS"
        )
    points = spline.control_points
    if len(points) * spline.degree**2 > MAXIMUM_COST:
        text = f"its trajectory has {len(points)} control points of degree {spline.degree}"
        return Fault(ErrorType.INSUFFICIENT_MEMORY, text, "divide the edge, or send fewer control points")
    first, last = curve.places(spline, 1)
    for place, node, which in ((first, start, "start"), (last, end, "end")):
        if node is not None and (off := dist(place, (node.x, node.y))) > END_TOLERANCE:
            text = f"its trajectory {which}s {off:.2f} m from its node"
            hint = f"make the trajectory {which} within {END_TOLERANCE:g} m of the node"
            return Fault(ErrorType.VALIDATION_FAILURE, text, hint)
    # a curve is never longer than the straight lines between its control points
    return _length_fault(sum(hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(points)))


def _spline_of(trajectory: Trajectory) -> PathTrajectory:
    """Return the trajectory as a NURBS, with defaults filled in.

    Raises:
        _InvalidTrajectoryError: it is invalid.
    """
    points, degree = trajectory.control_points, trajectory.degree or DEFAULT_DEGREE
    knots = trajectory.knot_vector
    if knots is None and len(points) > degree:
        knots = uniform_knots(len(points), degree)
    try:
        spline = PathTrajectory(
            degree=degree,
            knot_vector=knots or (),
            control_points=tuple(
                TrajectoryPoint(x=point.x, y=point.y, weight=1.0 if point.weight is None else point.weight)
                for point in points
            ),
        )
    except ValidationError as invalid:
        first = invalid.errors()[0]
        raise _InvalidTrajectoryError(f"has an invalid {first['loc'][-1]}: {first['msg']}") from None
    if problem := curve.fault(spline):
        raise _InvalidTrajectoryError(problem)
    if curve.has_gap(spline):
        raise _InvalidTrajectoryError("has a gap: a knot is repeated more often than the degree")
    return spline


def path_between(edge: Edge, start: NodePosition | None, end: NodePosition) -> tuple[Point, ...]:
    """Return the path along an edge: points at most ``STEP`` m apart, the last one at the node.

    It is empty if the edge is invalid, which is possible after a change of the settings.
    """
    # A corridor without a trajectory is around the straight line between its nodes (6.1.5).
    begin = (start.x, start.y) if start and edge.trajectory is None else None
    return _sample_path(edge.trajectory, begin, (end.x, end.y))


def planned_corners(
    edge: Edge, start: Node | None, end: Node, capabilities: Capabilities
) -> tuple[Point, ...]:
    """Return the corners of an edge's path after its start, for plannedPath in the state (section 6.6.2)."""
    position = end.node_position
    if position is None or not follows(edge, capabilities):
        return ()
    path = path_between(edge, start.node_position if start else None, position)
    return corners(path)[1:] if path else ()


@lru_cache(maxsize=256)
def _sample_path(trajectory: Trajectory | None, start: Point | None, end: Point) -> tuple[Point, ...]:
    if trajectory is not None:
        try:
            return (*curve.steps(_spline_of(trajectory), STEP)[:-1], end)
        except _InvalidTrajectoryError:
            return ()
    if start is None:
        return ()
    parts = max(1, ceil(dist(start, end) / STEP))
    (x, y), (dx, dy) = start, (end[0] - start[0], end[1] - start[1])
    return (*((x + dx * i / parts, y + dy * i / parts) for i in range(parts)), end)


def remaining(path: Sequence[Point], place: Point) -> tuple[Point, ...]:
    """Return the part of a path from ``place`` on; if the path crosses itself there, the longer part."""
    away = [dist(point, place) for point in path]
    limit = min(away) + STEP / 2
    index = next(index for index, length in enumerate(away) if length <= limit)
    return tuple(path[min(index, max(0, len(path) - 2)) :])


def first_part(path: Sequence[Point], length: float) -> tuple[Point, ...]:
    """Return the first part of a path, at least ``length`` m long."""
    kept = list(path[:1])
    for start, end in pairwise(path):
        length -= dist(start, end)
        kept.append(end)
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
    """Return the corners of a polyline that deviates from ``path`` by at most ``CORNER_TOLERANCE`` m."""
    kept, waiting = {0, len(path) - 1}, [(0, len(path) - 1)]
    while waiting:
        first, last = waiting.pop()
        line = (path[first], path[last])
        away = [
            (abs(_signed_distance(path[index], *line, 0.0, 1.0)), index) for index in range(first + 1, last)
        ]
        farthest, index = max(away, default=(0.0, 0))
        if farthest > CORNER_TOLERANCE:
            kept.add(index)
            waiting += [(first, index), (index, last)]
    return tuple(path[index] for index in sorted(kept))


def offset(path: Sequence[Point], place: Point) -> float:
    """Return the signed distance (m, positive to the left) from a path that is extended at both ends."""
    last = len(path) - 2
    found = (
        _signed_distance(place, a, b, -inf if index == 0 else 0.0, inf if index == last else 1.0)
        for index, (a, b) in enumerate(pairwise(path))
    )
    return min(found, key=abs, default=0.0)


def _signed_distance(place: Point, start: Point, end: Point, least: float, most: float) -> float:
    """Return the signed distance from the part of a line between ``least`` and ``most``; positive: left."""
    along, across = (end[0] - start[0], end[1] - start[1]), (place[0] - start[0], place[1] - start[1])
    square = along[0] ** 2 + along[1] ** 2
    share = 0.0
    if square > 0:
        share = max(least, min(most, (across[0] * along[0] + across[1] * along[1]) / square))
    away = hypot(across[0] - share * along[0], across[1] - share * along[1])
    return copysign(away, along[0] * across[1] - along[1] * across[0])


def metres_outside(
    path: Sequence[Point], corridor: Corridor | None, pose: Pose, footprint: Footprint
) -> float:
    """Return how far a robot at ``pose`` is beyond its allowed distance from ``path``, m; 0: within it.

    A corridor with releaseRequired is not used: the robot stays on the trajectory.
    """
    widths = (TRAJECTORY_TOLERANCE, TRAJECTORY_TOLERANCE)
    places: Sequence[Point] = ((pose.x, pose.y),)
    if corridor is not None and not corridor.release_required:
        widths = (corridor.left_width, corridor.right_width)
        if corridor.corridor_reference_point is CorridorReferencePoint.CONTOUR:
            places = footprint.at(pose)[0]
    offsets = [offset(path, corner) for corner in places]
    return max(0.0, max(offsets) - widths[0], -min(offsets) - widths[1])


# Along a robot's order


def path_of_edge(robot: RobotState, index: int = 0) -> tuple[Point, ...]:
    """Return the path of the next edge, or of the one ``index`` edges later; empty: navigation plans one."""
    progress = robot.progress
    edge = next(islice(progress.edges, index, None), None)
    node = next(islice(progress.nodes, index, None), None)
    previous = progress.last_node if index == 0 else next(islice(progress.nodes, index - 1, None), None)
    if edge is None or node is None or node.node_position is None:
        return ()
    if not follows(edge, robot.capabilities):
        return ()
    return path_between(edge, previous.node_position if previous else None, node.node_position)


def path_poses(robot: RobotState, pose: Pose, position: NodePosition) -> tuple[Pose, ...]:
    """Return the path from ``pose`` to the next node, at ``position``, and store it in the goal.

    If the previous path ends where this one begins, the rest of it comes first.
    """
    path = path_of_edge(robot)
    if not path:
        robot.goal.path = ()
        return ()
    place, before = (pose.x, pose.y), robot.goal.path
    if before and dist(before[-1], path[0]) <= END_TOLERANCE:
        path = (*remaining(before, place), *path[1:])
    else:
        path = remaining(path, place)
    robot.goal.path = path
    return poses(path, position.map_id, position.theta)


def outside_of_corridor(robot: RobotState) -> ErrorEntry | None:
    """Return the error of a robot that has left its corridor or trajectory (section 6.6.5), if it has."""
    metres = deviation_from_path(robot)
    if metres <= 0.0:
        return None
    edge = robot.progress.edges[0]
    area = f"{TRAJECTORY_TOLERANCE:g} m around the trajectory of edge '{edge.edge_id}'"
    if edge.corridor is not None and not edge.corridor.release_required:
        area = f"the corridor of edge '{edge.edge_id}'"
    return error(
        ErrorType.OUTSIDE_OF_CORRIDOR,
        f"the robot does not drive: it is {metres:.2f} m outside {area}",
        hint="move the robot back by hand and check its position on the map, or cancel the order",
        edge_id=edge.edge_id,
        order_id=robot.progress.order_id,
    )


def deviation_from_path(robot: RobotState) -> float:
    """Return how far the robot is outside its corridor or trajectory, m; 0: it may drive."""
    pose, path = robot.reports.localized_pose, path_of_edge(robot)
    if pose is None or not path or not robot.progress.edges[0].released:
        return 0.0
    # Within a node's deviation the robot need not be on the path (6.6.2, corner cutting).
    default = robot.capabilities.default_deviation_xy
    for node in (robot.progress.last_node, robot.progress.next_node):
        if node and node.node_position and is_within_deviation(pose, node.node_position, default):
            return 0.0
    corridor = robot.progress.edges[0].corridor
    return metres_outside(corners(path), corridor, pose, robot.capabilities.footprint)
