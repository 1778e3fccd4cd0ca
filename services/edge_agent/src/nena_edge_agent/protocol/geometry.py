"""Plane geometry in metres and radians: polygons, the robot's footprint, poses at nodes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from math import atan2, cos, hypot, pi, sin

from nena_edge_agent.driver.port import Pose
from nena_shared.vda5050.order import NodePosition

Point = tuple[float, float]
Polygon = tuple[Point, ...]
"""Corners of a simple polygon in order; the first one is not repeated."""
SHARP_BEND = 0.5
"""Bend above which a robot may turn on the spot, radians."""
BoundingBox = tuple[float, float, float, float]
"""Minimum x and y, maximum x and y."""


def rectangle(start: Point, end: Point, *, length: float, width: float, theta: float) -> Polygon:
    """Return the area covered by a rectangle that moves from ``start`` to ``end``, m.

    Its heading is the direction of travel; ``theta``, rad, if it does not move.
    """
    run = hypot(end[0] - start[0], end[1] - start[1])
    heading = atan2(end[1] - start[1], end[0] - start[0]) if run else theta
    ahead, side = (cos(heading), sin(heading)), (-sin(heading), cos(heading))
    corners = (
        (-0.5 * length, -0.5),
        (run + 0.5 * length, -0.5),
        (run + 0.5 * length, 0.5),
        (-0.5 * length, 0.5),
    )
    return tuple(
        (
            start[0] + along * ahead[0] + across * width * side[0],
            start[1] + along * ahead[1] + across * width * side[1],
        )
        for along, across in corners
    )


def turning_circle(centre: Point, *, length: float, width: float) -> Polygon:
    """Return an octagon around the area covered by a rectangle that turns about its centre."""
    radius = hypot(length, width) / 2 / cos(pi / 8)
    angles = (pi / 8 + index * pi / 4 for index in range(8))
    return tuple((centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)) for angle in angles)


def bounding_box(polygon: Polygon) -> BoundingBox:
    """Return the axis-aligned bounding box of ``polygon``."""
    xs, ys = zip(*polygon, strict=True)
    return min(xs), min(ys), max(xs), max(ys)


def boxes_intersect(one: BoundingBox, other: BoundingBox) -> bool:
    """Return whether two bounding boxes intersect; if not, neither do their contents."""
    return one[0] <= other[2] and other[0] <= one[2] and one[1] <= other[3] and other[1] <= one[3]


def polygons_overlap(one: Polygon, other: Polygon) -> bool:
    """Return whether two polygons intersect."""
    return (
        any(_segments_cross(*side, *cut) for side in _sides_of(one) for cut in _sides_of(other))
        or contains(one, other[0])
        or contains(other, one[0])
    )


def contains(polygon: Polygon, point: Point) -> bool:
    """Return whether ``point`` is inside ``polygon``; undefined on the border."""
    x, y = point
    inside = False
    for (x1, y1), (x2, y2) in _sides_of(polygon):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            inside = not inside
    return inside


def is_simple(polygon: Polygon) -> bool:
    """Return whether no two sides touch except neighbours at their corner, and the polygon has an area."""
    sides = list(_sides_of(polygon))
    last = len(sides) - 1
    apart = ((i, j) for i, j in combinations(range(len(sides)), 2) if j - i > 1 and (i, j) != (0, last))
    area = sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in sides)
    return bool(area) and not any(_segments_cross(*sides[i], *sides[j]) for i, j in apart)


def _sides_of(polygon: Polygon) -> Iterator[tuple[Point, Point]]:
    return zip(polygon, (*polygon[1:], polygon[0]), strict=True)


def _segments_cross(a: Point, b: Point, c: Point, d: Point) -> bool:
    """Return whether the segments a-b and c-d have a point in common."""
    first, second = _turn_area(a, b, c), _turn_area(a, b, d)
    third, fourth = _turn_area(c, d, a), _turn_area(c, d, b)
    if first * second < 0 and third * fourth < 0:
        return True
    ends = ((first, a, b, c), (second, a, b, d), (third, c, d, a), (fourth, c, d, b))
    # A point on the line through both ends touches the segment if it is between them.
    return any(
        turn_area == 0 and all(min(s, e) <= p <= max(s, e) for s, e, p in zip(start, end, point, strict=True))
        for turn_area, start, end, point in ends
    )


def _turn_area(a: Point, b: Point, c: Point) -> float:
    """Return twice the area of the triangle; positive if c is to the left of a-b."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def radius(position: NodePosition, default: float) -> float:
    """Return the deviation allowed in every direction, m; ``default`` if it is 0 or missing."""
    allowed = position.allowed_deviation_xy
    return min(allowed.a, allowed.b) or default if allowed else default


def distance(start: Pose | NodePosition, end: Pose | NodePosition) -> float:
    """Return the straight-line distance, m."""
    return hypot(start.x - end.x, start.y - end.y)


def is_within_deviation(pose: Pose, position: NodePosition, default: float) -> bool:
    """Return whether ``pose`` is within the allowed ellipse around ``position``, on its map (section 6.6.2).

    ``default`` is the allowed deviation, m, if ``position`` has none.
    """
    if pose.map_id != position.map_id:
        return False
    allowed = position.allowed_deviation_xy
    if allowed is None or not (allowed.a and allowed.b):
        return distance(pose, position) <= default
    dx, dy = pose.x - position.x, pose.y - position.y
    along = dx * cos(allowed.theta) + dy * sin(allowed.theta)
    across = dy * cos(allowed.theta) - dx * sin(allowed.theta)
    return hypot(along / allowed.a, across / allowed.b) <= 1.0


def heading_matches(pose: Pose, position: NodePosition, default: float) -> bool:
    """Return whether the robot's heading is allowed at ``position`` (section 6.6.2).

    Without a theta, any heading is allowed. ``default`` is the allowed deviation, rad, if there is none.
    """
    if position.theta is None:
        return True
    return abs(turn(position.theta, pose.theta)) <= (position.allowed_deviation_theta or default)


def turn(start: float, end: float) -> float:
    """Return the shortest turn from ``start`` to ``end``, in [-π, π)."""
    return (end - start + pi) % (2 * pi) - pi


def is_same_position(one: NodePosition, other: NodePosition) -> bool:
    """Return whether a robot at ``one`` is also at ``other``, with its heading if that has one."""
    there = (one.x, one.y, one.map_id) == (other.x, other.y, other.map_id)
    return there and other.theta in (None, one.theta)


@dataclass(frozen=True, slots=True)
class Footprint:
    """The robot's contour: a rectangle around its centre, m."""

    length: float
    width: float

    def at(self, pose: Pose) -> tuple[Polygon, ...]:
        """Return the area that the robot covers at ``pose``."""
        place = (pose.x, pose.y)
        return (rectangle(place, place, length=self.length, width=self.width, theta=pose.theta),)

    def along_path(self, start: Pose | NodePosition, end: NodePosition) -> tuple[Polygon, ...]:
        """Return the area that the robot covers on the straight path to ``end``, and by turning there."""
        begin, place = (start.x, start.y), (end.x, end.y)
        return (
            rectangle(begin, place, length=self.length, width=self.width, theta=start.theta or 0.0),
            turning_circle(place, length=self.length, width=self.width),
        )

    def along_corners(self, corners: Sequence[Point]) -> tuple[Polygon, ...]:
        """Return the area that the robot covers on the path through ``corners``, and by turning there."""
        size = {"length": self.length, "width": self.width}
        sharp = [
            b
            for a, b, c in zip(corners, corners[1:], corners[2:], strict=False)
            if abs(turn(atan2(b[1] - a[1], b[0] - a[0]), atan2(c[1] - b[1], c[0] - b[0]))) > SHARP_BEND
        ]
        return (
            *(rectangle(start, end, **size, theta=0.0) for start, end in pairwise(corners)),
            *(turning_circle(corner, **size) for corner in (*sharp, *corners[-1:])),
        )
