"""Between the plant's frame and that of the robot's map: once in, once out, and the same way back."""

from __future__ import annotations

from math import cos, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.map_port import (
    MapArea,
    MapDriver,
    MapDriverEvent,
    MapEmit,
    MapGoal,
    MapOwnGoals,
    MapPlanReport,
    MapPose,
    MapPoseReport,
)
from nena_edge_agent.driver.plant_frame import PlantFrame, PlantFrameDriver
from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    DriveGoal,
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


class MapRobot:
    """A driver on the map: stores its commands, and emits the test's events."""

    def __init__(self, emit: MapEmit) -> None:
        self.emit = emit
        self.told: list[object] = []
        self.limits: list[float | None] = []

    async def start(self) -> None:
        self.told.append("start")

    async def stop(self) -> None:
        self.told.append("stop")

    def halt(self) -> None:
        self.told.append("halt")

    def keep_out(self, areas: tuple[MapArea, ...]) -> None:
        self.areas = areas

    def limit_speed(self, speed: float | None) -> None:
        self.limits.append(speed)

    def reclaim(self, goals: MapOwnGoals) -> None:
        self.told.append(goals)

    def go_to(self, goal: MapGoal) -> None:
        self.told.append(goal)

    def initialize_position(self, pose: MapPose) -> None:
        self.told.append(pose)


def framed() -> tuple[PlantFrameDriver, MapRobot, list[DriverEvent]]:
    robots: list[MapRobot] = []
    heard: list[DriverEvent] = []

    def make(emit: MapEmit) -> MapDriver:
        robots.append(MapRobot(emit))
        return robots[0]

    return PlantFrameDriver(make, FRAME, heard.append), robots[0], heard


def close(pose: object) -> object:
    """Compare places on the hall's map with room for rounding."""
    assert isinstance(pose, Pose | MapPose)
    return pytest.approx((pose.x, pose.y, pose.theta))


@pytest.mark.clause("6.3/frame")
def test_goals_are_sent_in_the_maps_frame() -> None:
    driver, robot, _ = framed()
    driver.go_to(DriveGoal(7, Pose(1.0, 2.0, 0.5, "hall"), 0.3, 0.2, 0.8))
    (goal,) = robot.told
    assert isinstance(goal, MapGoal)
    assert (6.0, -3.0, 0.5 + pi / 2) == close(goal.pose)
    assert (goal.generation, goal.pose.map_id) == (7, "hall")
    assert goal.deviation_xy == pytest.approx(0.6)
    assert (goal.deviation_theta, goal.maximum_speed) == (0.2, 0.8)


@pytest.mark.clause("6.3/frame")
def test_an_initial_position_and_earlier_goals_are_sent_in_the_maps_frame() -> None:
    driver, robot, _ = framed()
    driver.initialize_position(Pose(1.0, 2.0, 0.0, "hall"))
    driver.reclaim(OwnGoals(("a", "b"), Pose(1.0, 2.0, 0.0, "hall"), Pose(3.0, 2.0, 0.0, "hall"), "a"))
    pose, goals = robot.told
    assert (6.0, -3.0, pi / 2) == close(pose)
    assert isinstance(goals, MapOwnGoals)
    assert (goals.goal_ids, goals.behind) == (("a", "b"), "a")
    assert goals.given is not None
    assert (6.0, 1.0, pi / 2) == close(goals.given)
    assert (6.0, -3.0, pi / 2) == close(goals.pose)


@pytest.mark.clause("6.3/frame")
def test_pose_and_plan_are_reported_in_the_plants_frame() -> None:
    _, robot, heard = framed()
    robot.emit(
        MapPoseReport(MapPose(6.0, -3.0, 2.0, "hall"), localized=False, vx=0.7, omega=-0.1, problem="?")
    )
    robot.emit(MapPlanReport(((10.0, -5.0), (6.0, -3.0)), "hall"))
    report, plan = heard
    assert isinstance(report, PoseReport)
    assert (1.0, 2.0, 2.0 - pi / 2) == close(report.pose)
    assert (report.localized, report.vx, report.omega, report.problem) == (False, 0.7, -0.1, "?")
    assert isinstance(plan, PlanReport)
    assert [pytest.approx(point, abs=1e-9) for point in plan.points] == [(0.0, 0.0), (1.0, 2.0)]


def test_events_without_coordinates_pass_unchanged() -> None:
    _, robot, heard = framed()
    events: list[MapDriverEvent] = [
        Arrived(3),
        Halted(),
        NavigationReport(available=True, reason=""),
        BatteryReport(50.0, charging=False),
    ]
    for event in events:
        robot.emit(event)
    assert heard == events


async def test_other_methods_are_the_drivers_own() -> None:
    driver, robot, _ = framed()
    await driver.start()
    driver.halt()
    driver.limit_speed(0.4)
    await driver.stop()
    assert (robot.told, robot.limits) == (["start", "halt", "stop"], [0.4])


def test_a_map_without_a_transform_has_the_plants_frame() -> None:
    pose = FRAME.to_map(Pose(1.25, -7.5, 3.0, "cellar"))
    assert pose == MapPose(1.25, -7.5, 3.0, "cellar")
    assert FRAME.to_plant(pose) == Pose(1.25, -7.5, 3.0, "cellar")


@given(TEXTS, METRES, METRES, st.floats(-pi, pi))
def test_a_round_trip_conversion_is_the_same_pose(text: str, x: float, y: float, theta: float) -> None:
    frame = PlantFrame.of({"hall": text})
    back = frame.to_plant(frame.to_map(Pose(x, y, theta, "hall")))
    assert (back.x, back.y) == pytest.approx((x, y), abs=1e-6)
    assert cos(back.theta - theta) == pytest.approx(1.0)


def test_the_remaining_distance_is_in_metres_of_the_plant() -> None:
    assert FRAME.event(DriveProgress(8.0, 1, "hall")) == DriveProgress(4.0, 1, "hall")
    assert FRAME.event(DriveProgress(8.0, 1, "attic")) == DriveProgress(8.0, 1, "attic")
