"""Paths of trajectories and corridors, without a robot."""

from __future__ import annotations

from itertools import accumulate, pairwise
from math import asin, cos, dist, hypot, pi, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol import edge_paths
from nena_edge_agent.protocol.geometry import Footprint
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.order import (
    ControlPoint,
    Corridor,
    CorridorReferencePoint,
    Edge,
    NodePosition,
    Trajectory,
)

ROBOT = Footprint(length=0.8, width=0.6)
QUARTER = (ControlPoint(x=0, y=0), ControlPoint(x=10, y=0), ControlPoint(x=10, y=10))


def at(x: float, y: float) -> NodePosition:
    return NodePosition(x=x, y=y, map_id="hall")


def edge(trajectory: Trajectory | None = None, corridor: Corridor | None = None) -> Edge:
    return Edge(
        edge_id="e", sequence_id=1, released=True, actions=(), trajectory=trajectory, corridor=corridor
    )


def arc(**fields: object) -> Trajectory:
    values = {"degree": 2, "knot_vector": (0, 0, 0, 1, 1, 1), "control_points": QUARTER, **fields}
    return Trajectory.model_validate(values)


def narrow(
    left: float, right: float, point: CorridorReferencePoint | None = None, *, asks: bool | None = None
) -> Corridor:
    return Corridor(left_width=left, right_width=right, corridor_reference_point=point, release_required=asks)


@st.composite
def rising(draw: st.DrawFn) -> Trajectory:
    """Draw a clamped NURBS whose control points go on along x, with weights and inner knots."""
    degree = draw(st.integers(1, 4))
    inner = sorted(draw(st.sets(st.sampled_from([0.2, 0.4, 0.5, 0.7]), max_size=4)))
    count = degree + 1 + len(inner)
    xs = sorted(draw(st.lists(st.floats(0, 40), min_size=count, max_size=count)))
    points = tuple(
        ControlPoint(x=x, y=draw(st.floats(-20, 20)), weight=draw(st.floats(0.2, 5.0))) for x in xs
    )
    knots = (*[0.0] * (degree + 1), *inner, *[1.0] * (degree + 1))
    return Trajectory(degree=degree, knot_vector=knots, control_points=points)


@pytest.mark.clause("7.3/trajectory")
@given(rising())
def test_a_path_is_continuous_with_short_steps_between_both_ends(drawn: Trajectory) -> None:
    first, last = drawn.control_points[0], drawn.control_points[-1]
    path = edge_paths.path_between(edge(drawn), at(first.x, first.y), at(last.x, last.y))
    assert path[0] == pytest.approx((first.x, first.y))
    assert path[-1] == (last.x, last.y)
    for before, after in pairwise(path):
        assert dist(before, after) <= edge_paths.STEP + 1e-9
        assert after[0] >= before[0] - 1e-9, "the curve goes on along x, and so does the path"


def test_weights_can_describe_a_circle() -> None:
    points = (*QUARTER[:1], QUARTER[1].model_copy(update={"weight": 0.5**0.5}), *QUARTER[2:])
    path = edge_paths.path_between(edge(arc(control_points=points)), at(0, 0), at(10, 10))
    assert [hypot(x - 0, y - 10) for x, y in path] == pytest.approx([10.0] * len(path))


def test_a_trajectory_without_degree_and_knots_is_a_polyline() -> None:
    bare = Trajectory(control_points=QUARTER)
    path = edge_paths.path_between(edge(bare), at(0, 0), at(10, 10))
    assert list(edge_paths.corners(path)) == [(0, 0), (10, 0), (10, 10)]


def test_a_corridor_without_a_trajectory_is_driven_along_its_centre() -> None:
    path = edge_paths.path_between(edge(corridor=narrow(1, 1)), at(0, 0), at(3, 4))
    assert (path[0], path[-1]) == ((0, 0), (3, 4))
    assert max(abs(edge_paths.offset(((0, 0), (3, 4)), each)) for each in path) < 1e-9
    assert all(dist(*pair) <= edge_paths.STEP + 1e-9 for pair in pairwise(path))


@pytest.mark.clause("7.3/trajectory", "6.1.4.2")
@pytest.mark.parametrize(
    ("fields", "kind", "said"),
    [
        ({"knot_vector": (0, 0, 1, 1)}, ErrorType.VALIDATION_FAILURE, "has 4 knots and needs 6"),
        ({"knot_vector": (0, 0, 0.5, 0.4, 1, 1)}, ErrorType.VALIDATION_FAILURE, "decrease"),
        ({"knot_vector": (0,) * 6}, ErrorType.VALIDATION_FAILURE, "no span between"),
        ({"degree": 3, "knot_vector": None}, ErrorType.VALIDATION_FAILURE, "3 control points for degree 3"),
        ({"degree": 40}, ErrorType.VALIDATION_FAILURE, "invalid degree"),
        (
            {
                "degree": 1,
                "knot_vector": (0, 0, 0.5, 0.5, 1, 1),
                "control_points": (*QUARTER, ControlPoint(x=10, y=10)),
            },
            ErrorType.VALIDATION_FAILURE,
            "has a gap",
        ),
        (
            {"control_points": (ControlPoint(x=0, y=0), ControlPoint(x=1, y=0, weight=0), QUARTER[2])},
            ErrorType.VALIDATION_FAILURE,
            "invalid weight",
        ),
        (
            {"control_points": (ControlPoint(x=0.2, y=0), *QUARTER[1:])},
            ErrorType.VALIDATION_FAILURE,
            "starts 0.20 m from its node",
        ),
        (
            {"control_points": (*QUARTER[:2], ControlPoint(x=10, y=9))},
            ErrorType.VALIDATION_FAILURE,
            "ends 1.00 m from its node",
        ),
        (
            {"control_points": (QUARTER[0], ControlPoint(x=900, y=0), QUARTER[2])},
            ErrorType.INSUFFICIENT_MEMORY,
            "1000 m at most",
        ),
    ],
)
def test_a_trajectory_that_misses_its_nodes_is_refused(
    fields: dict[str, object], kind: ErrorType, said: str
) -> None:
    found = edge_paths.edge_fault(edge(arc(**fields)), at(0, 0), at(10, 10), ROBOT)
    assert found is not None
    assert found.kind is kind
    assert said in found.text


def test_a_trajectory_that_is_too_expensive_is_refused_at_once() -> None:
    many = Trajectory(control_points=tuple(ControlPoint(x=i / 5000, y=0) for i in range(10_002)))
    found = edge_paths.edge_fault(edge(many), at(0, 0), at(2, 0), ROBOT)
    assert found is not None
    assert found.kind is ErrorType.INSUFFICIENT_MEMORY


def test_a_corridor_without_trajectory_requires_the_position_of_its_start() -> None:
    found = edge_paths.edge_fault(edge(corridor=narrow(1, 1)), None, at(1, 0), ROBOT)
    assert found is not None
    assert found.kind is ErrorType.VALIDATION_FAILURE
    assert edge_paths.path_between(edge(corridor=narrow(1, 1)), None, at(1, 0)) == ()


def roundabout(radius: float, angle: float) -> Trajectory:
    """Return a drive around a circle, over ``angle`` rad of it."""
    count = max(2, round(radius * angle / 0.1))
    return Trajectory(
        degree=1,
        control_points=tuple(
            ControlPoint(x=radius * cos(angle * i / count), y=radius * sin(angle * i / count))
            for i in range(count + 1)
        ),
    )


def returns(drawn: Trajectory, tolerance: float | None) -> bool:
    """Return whether a trajectory is refused because it passes its own end."""
    first, last = drawn.control_points[0], drawn.control_points[-1]
    found = edge_paths.edge_fault(edge(drawn), at(first.x, first.y), at(last.x, last.y), ROBOT, tolerance)
    assert found is None or found.kind is ErrorType.UNSUPPORTED_PARAMETER
    return found is not None


@given(st.floats(1.5, 8.0), st.floats(0.1, 4.0), st.sampled_from([0.1, 0.25, 0.5]))
def test_a_path_that_passes_its_end_is_refused(radius: float, laps: float, tolerance: float) -> None:
    """A controller counts it as driven where it first is within its tolerance of the end."""
    passes = 2 * pi - 2 * asin(tolerance / (2 * radius))
    angle = laps * pi
    assume(abs(angle - passes) * radius > 2 * edge_paths.STEP)
    assert returns(roundabout(radius, angle), tolerance) is (angle > passes)


@pytest.mark.parametrize(("tolerance", "refused"), [(0.25, False), (0.4, True), (None, True)])
def test_the_tolerance_decides_whether_a_path_returns_to_its_end(
    tolerance: float | None, *, refused: bool
) -> None:
    almost = roundabout(5.0, 2 * pi - 2 * asin(0.3 / 10))
    assert returns(almost, tolerance) is refused


@given(rising())
def test_an_approach_to_the_end_is_not_a_loop(drawn: Trajectory) -> None:
    first, last = drawn.control_points[0], drawn.control_points[-1]
    path = edge_paths.path_between(edge(drawn), at(first.x, first.y), at(last.x, last.y))
    found = edge_paths.edge_fault(edge(drawn), at(first.x, first.y), at(last.x, last.y), ROBOT, 0.25)
    around = [dist(each, path[-1]) for each in path]
    steps = (dist(a, b) for a, b in pairwise(reversed(path)))
    lengths = reversed([*accumulate(steps, initial=0.0)])
    early = any(
        away <= 0.25 and left > 0.25 + edge_paths.DETOUR for away, left in zip(around, lengths, strict=True)
    )
    assert (found is not None) is early


CONTOUR = CorridorReferencePoint.CONTOUR


@pytest.mark.clause("6.1.5")
@pytest.mark.parametrize(
    ("corridor", "fits"),
    [
        (narrow(0.0, 0.0), True),
        (narrow(0.0, 0.0, CorridorReferencePoint.KINEMATIC_CENTER), True),
        (narrow(0.35, 0.35, CONTOUR), True),
        (narrow(0.25, 0.35, CONTOUR), False),
        (narrow(0.35, 0.25, CONTOUR), False),
        (narrow(0.25, 0.25, CONTOUR, asks=True), True),
    ],
)
def test_a_path_stays_inside_of_its_corridor_or_is_refused(corridor: Corridor, *, fits: bool) -> None:
    found = edge_paths.edge_fault(edge(arc(), corridor), at(0, 0), at(10, 10), ROBOT)
    assert (found is None) is fits
    if found is not None:
        assert found.kind is ErrorType.NO_ROUTE_TO_TARGET


@pytest.mark.clause("6.1.5")
@pytest.mark.parametrize(
    ("corridor", "y", "outside"),
    [
        (narrow(0.4, 0.2), 0.3, 0.0),
        (narrow(0.4, 0.2), 0.5, 0.1),
        (narrow(0.4, 0.2), -0.3, 0.1),
        (narrow(0.4, 0.4, CONTOUR), 0.0, 0.0),
        (narrow(0.4, 0.4, CONTOUR), 0.3, 0.2),
        (narrow(9.0, 9.0, asks=True), 0.6, 0.1),
        (None, 0.4, 0.0),
        (None, -0.6, 0.1),
    ],
)
def test_the_distance_outside_a_corridor_is_measured(
    corridor: Corridor | None, y: float, outside: float
) -> None:
    pose = Pose(5.0, y, 0.0, "hall")
    assert edge_paths.metres_outside(((0, 0), (10, 0)), corridor, pose, ROBOT) == pytest.approx(outside)


def test_the_remaining_path_begins_at_the_robot() -> None:
    path = edge_paths.path_between(edge(arc()), at(0, 0), at(10, 10))
    middle = path[len(path) // 2]
    left = edge_paths.remaining(path, (middle[0] + 0.2, middle[1] - 0.2))
    assert dist(left[0], middle) <= 2 * edge_paths.STEP
    assert left == path[-len(left) :]
    assert len(edge_paths.remaining(path, (10, 10))) >= 2


def test_a_path_that_crosses_itself_is_not_cut_short() -> None:
    loop = tuple(ControlPoint(x=x, y=y) for x, y in ((0, 0), (10, 0), (10, 10), (5, 10), (5, -5)))
    path = edge_paths.path_between(edge(Trajectory(control_points=loop)), at(0, 0), at(5, -5))
    assert len(edge_paths.remaining(path, (5, 0))) > 200


def test_poses_have_the_heading_of_travel_and_the_last_one_that_of_its_node() -> None:
    path = edge_paths.path_between(edge(arc()), at(0, 0), at(10, 10))
    found = edge_paths.poses(path, "hall")
    assert found[0].theta == pytest.approx(0.0, abs=0.05)
    assert found[-1].theta == pytest.approx(1.57, abs=0.05)
    assert edge_paths.poses(path, "hall", 3.0)[-1].theta == 3.0


def test_the_first_metres_of_a_path() -> None:
    path = edge_paths.path_between(edge(corridor=narrow(1, 1)), at(0, 0), at(5, 0))
    assert edge_paths.first_part(path, 2.0)[-1][0] == pytest.approx(2.0, abs=edge_paths.STEP)
