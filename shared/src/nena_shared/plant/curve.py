"""Evaluate NURBS trajectories, in metres in the plant frame."""

from bisect import bisect_left, bisect_right
from collections import Counter
from itertools import pairwise
from math import hypot
from typing import Final

from nena_shared.plant.track import PathTrajectory

Place = tuple[float, float]
_SAMPLES: Final = 64
_PARTS: Final = 4
"""Minimum number of parts per degree for each segment of a curve, so that loops are not missed."""

# with these knots and degree 3, a NURBS of LIF is a BEZIER of openTCS
CUBIC_BEZIER_KNOTS: Final = (0.0,) * 4 + (1.0,) * 4


def fault(trajectory: PathTrajectory) -> str:
    """Return what is wrong with a curve, as a predicate ("has ..."); empty if it is valid."""
    knots, points = trajectory.knot_vector, trajectory.control_points
    wanted = len(points) + trajectory.degree + 1
    if len(points) <= trajectory.degree:
        return f"has {len(points)} control points for degree {trajectory.degree}"
    if len(knots) != wanted:
        return f"has {len(knots)} knots and needs {wanted}"
    if any(following < knot for knot, following in pairwise(knots)):
        return "has knots that decrease"
    # a NURBS is only defined between these two knots, which are its ends
    if knots[trajectory.degree] == knots[-trajectory.degree - 1]:
        return "has no span between its knots"
    return ""


def has_gap(trajectory: PathTrajectory) -> bool:
    """Return whether a valid curve may have a gap: an inner knot occurs more often than the degree."""
    knots, degree = trajectory.knot_vector, trajectory.degree
    inner = Counter(knot for knot in knots if knots[degree] < knot < knots[-degree - 1])
    return any(count > degree for count in inner.values())


def places(trajectory: PathTrajectory, samples: int = _SAMPLES) -> tuple[Place, ...]:
    """Return ``samples`` + 1 points along a valid curve, including both ends."""
    knots, degree = trajectory.knot_vector, trajectory.degree
    first, last = knots[degree], knots[-degree - 1]
    return tuple(_place_at(trajectory, first + (last - first) * i / samples) for i in range(samples + 1))


def steps(trajectory: PathTrajectory, longest: float) -> tuple[Place, ...]:
    """Return points along a valid curve, including both ends, at most ``longest`` m apart."""
    knots, degree = trajectory.knot_vector, trajectory.degree
    line = [_place_at(trajectory, knots[degree])]
    for low, high in pairwise(sorted(set(knots[degree : len(knots) - degree]))):
        cuts = [low + (high - low) * i / (_PARTS * degree) for i in range(1, _PARTS * degree)]
        for part in pairwise((low, *cuts, high)):
            _add_steps(trajectory, part, longest, line)
    return tuple(line)


def _add_steps(
    trajectory: PathTrajectory, part: tuple[float, float], longest: float, line: list[Place]
) -> None:
    """Append the points of a part of the curve; its start is already the last of ``line``."""
    waiting = [part]
    while waiting:
        low, high = waiting.pop()
        middle, end = (low + high) / 2, _place_at(trajectory, high)
        # a part that floats cannot halve any more ends the search at a jump of the curve
        if hypot(end[0] - line[-1][0], end[1] - line[-1][1]) <= longest or not low < middle < high:
            line.append(end)
        else:  # the nearer half is taken next
            waiting += [(middle, high), (low, middle)]


def length(trajectory: PathTrajectory) -> float:
    """Return the length of a valid curve, m."""
    return sum(hypot(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise(places(trajectory)))


def scaled(trajectory: PathTrajectory) -> PathTrajectory:
    """Return a valid curve with its knots scaled to 0 to 1."""
    # VDA 5050 3.0, 7.3 and LIF have knots from 0 to 1; some LIF files go beyond
    knots = trajectory.knot_vector
    if knots[0] >= 0 and knots[-1] <= 1:
        return trajectory
    span = knots[-1] - knots[0]
    return trajectory.model_copy(update={"knot_vector": tuple((knot - knots[0]) / span for knot in knots)})


def is_cubic_bezier(trajectory: PathTrajectory) -> bool:
    """Return whether a curve is a single cubic Bezier curve without weights."""
    # equal weights cancel out in a rational curve
    weights = {point.weight for point in trajectory.control_points}
    return (trajectory.degree, trajectory.knot_vector) == (3, CUBIC_BEZIER_KNOTS) and len(weights) == 1


def _place_at(trajectory: PathTrajectory, at: float) -> Place:
    """Return the point at parameter ``at``, by de Boor's algorithm for rational curves."""
    knots, degree = trajectory.knot_vector, trajectory.degree
    # the end of the curve belongs to its last span, not to the empty one behind it
    last = bisect_left(knots, knots[-degree - 1]) - 1
    span = min(bisect_right(knots, at) - 1, last)
    near = trajectory.control_points[span - degree : span + 1]
    row = [(point.x * point.weight, point.y * point.weight, point.weight) for point in near]
    for level in range(1, degree + 1):
        for i in range(degree, level - 1, -1):
            low, high = knots[i + span - degree], knots[i + 1 + span - level]
            part = (at - low) / (high - low)
            row[i] = tuple((1 - part) * a + part * b for a, b in zip(row[i - 1], row[i], strict=True))  # type: ignore[assignment]  # three of each
    x, y, weight = row[degree]
    return x / weight, y / weight
