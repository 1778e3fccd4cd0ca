"""Between the plant's frame and that of the robot's map: once in, once out, and the same way back."""

from __future__ import annotations

from math import cos, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.plant_frame import PlantFrame
from nena_edge_agent.driver.port import (
    Area,
    Arrived,
    BatteryReport,
    DriveGoal,
    DriveLimits,
    DriveProgress,
    DriverEvent,
    Halted,
    NavigationReport,
    OwnGoals,
    PlanReport,
    Pose,
    PoseReport,
)

TEXT = "scale=2 rotation=90 x=10 y=-5"
FRAME = PlantFrame.of({"hall": TEXT})
METRES = st.floats(-1000, 1000)
TEXTS = st.builds(
    "scale={} rotation={} x={} y={}".format, st.floats(0.01, 100), st.floats(-720, 720), METRES, METRES
)


def close(pose: Pose) -> object:
    """Compare places on the hall's map with room for rounding."""
    return pytest.approx((pose.x, pose.y, pose.theta))


@pytest.mark.clause("6.3/frame")
def test_goals_are_sent_in_the_maps_frame() -> None:
    ahead = (Pose(3.0, 2.0, 0.0, "hall"),)
    goal = FRAME.goal_to_map(DriveGoal(7, Pose(1.0, 2.0, 0.5, "hall"), 0.3, 0.2, 0.8, ahead, "tree"))
    assert (6.0, -3.0, 0.5 + pi / 2) == close(goal.pose)
    assert (6.0, 1.0, pi / 2) == close(goal.ahead[0])
    assert (goal.generation, goal.pose.map_id, goal.behavior_tree) == (7, "hall", "tree")
    assert goal.deviation_xy == pytest.approx(0.6)
    assert (goal.deviation_theta, goal.maximum_speed) == (0.2, 0.8)


@pytest.mark.clause("6.3/frame")
def test_an_initial_position_and_earlier_goals_are_sent_in_the_maps_frame() -> None:
    assert (6.0, -3.0, pi / 2) == close(FRAME.to_map(Pose(1.0, 2.0, 0.0, "hall")))
    own = OwnGoals(("a", "b"), Pose(1.0, 2.0, 0.0, "hall"), Pose(3.0, 2.0, 0.0, "hall"), "a")
    goals = FRAME.own_goals_to_map(own)
    assert (goals.goal_ids, goals.behind) == (("a", "b"), "a")
    assert goals.given is not None
    assert (6.0, 1.0, pi / 2) == close(goals.given)
    assert (6.0, -3.0, pi / 2) == close(goals.pose)


@pytest.mark.clause("6.3/frame")
def test_areas_are_sent_in_the_maps_frame() -> None:
    area = FRAME.area_to_map(Area("hall", ((0.0, 0.0), (1.0, 2.0))))
    assert area.map_id == "hall"
    assert [pytest.approx(point) for point in area.points] == [(10.0, -5.0), (6.0, -3.0)]


@pytest.mark.clause("6.3/frame")
def test_pose_and_plan_are_reported_in_the_plants_frame() -> None:
    pose = PoseReport(Pose(6.0, -3.0, 2.0, "hall"), localized=False, vx=0.7, omega=-0.1, problem="?")
    report = FRAME.event_to_plant(pose)
    plan = FRAME.event_to_plant(PlanReport(((10.0, -5.0), (6.0, -3.0)), "hall"))
    assert isinstance(report, PoseReport)
    assert (1.0, 2.0, 2.0 - pi / 2) == close(report.pose)
    assert (report.localized, report.vx, report.omega, report.problem) == (False, 0.7, -0.1, "?")
    assert isinstance(plan, PlanReport)
    assert [pytest.approx(point, abs=1e-9) for point in plan.points] == [(0.0, 0.0), (1.0, 2.0)]


def test_events_without_coordinates_pass_unchanged() -> None:
    events: list[DriverEvent] = [
        Arrived(3),
        Halted(),
        NavigationReport(available=True, reason=""),
        BatteryReport(50.0, charging=False),
    ]
    assert list(map(FRAME.event_to_plant, events)) == events


def test_a_map_without_a_transform_has_the_plants_frame() -> None:
    pose = FRAME.to_map(Pose(1.25, -7.5, 3.0, "cellar"))
    assert pose == Pose(1.25, -7.5, 3.0, "cellar")
    assert FRAME.to_plant(pose) == Pose(1.25, -7.5, 3.0, "cellar")


@given(TEXTS, METRES, METRES, st.floats(-pi, pi))
def test_a_round_trip_conversion_is_the_same_pose(text: str, x: float, y: float, theta: float) -> None:
    frame = PlantFrame.of({"hall": text})
    back = frame.to_plant(frame.to_map(Pose(x, y, theta, "hall")))
    assert (back.x, back.y) == pytest.approx((x, y), abs=1e-6)
    assert cos(back.theta - theta) == pytest.approx(1.0)


def test_the_remaining_distance_is_in_metres_of_the_plant() -> None:
    assert FRAME.event_to_plant(DriveProgress(8.0, 1, "hall")) == DriveProgress(4.0, 1, "hall")
    assert FRAME.event_to_plant(DriveProgress(8.0, 1, "attic")) == DriveProgress(8.0, 1, "attic")


def test_limits_are_in_metres_of_the_plant() -> None:
    limits = DriveLimits(0.5, 1.0, "hall", ((2.0, 0.0), (0.0, 2.0)), 0.1)
    expected = DriveLimits(0.25, 0.5, "hall", ((1.0, 0.0), (0.0, 1.0)), 0.1)
    assert FRAME.event_to_plant(limits) == expected
