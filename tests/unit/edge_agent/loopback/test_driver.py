from __future__ import annotations

from math import pi
from typing import TypeVar

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    Circle,
    DriveFailed,
    DriveGoal,
    DriverEvent,
    Halted,
    NavigationReport,
    Pose,
    PoseReport,
    PositionInitialized,
)
from nena_edge_agent.loopback.driver import LoopbackDriver, Motion, SimulatedBattery, plan_braking
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_shared.clock import SystemClock
from support.waiting import until

E = TypeVar("E")


class Ride:
    def __init__(self, **settings: object) -> None:
        values = {"speed": 20.0, "turn_rate": 50.0, "pose_interval": 0.01, **settings}
        self.events: list[DriverEvent] = []
        self.driver = LoopbackDriver(
            LoopbackSettings.model_validate(values),
            Pose(1.0, 0.0, 0.0, "m"),
            emit=self.events.append,
            clock=SystemClock(),
        )

    def go(self, generation: int, x: float, *, map_id: str = "m") -> None:
        self.driver.go_to(DriveGoal(generation, Pose(x, 0.0, 0.0, map_id), 0.3))

    def seen(self, kind: type[E]) -> list[E]:
        return [event for event in self.events if isinstance(event, kind)]

    async def wait_for(self, kind: type[E]) -> E:
        (first, *_) = await until(lambda: self.seen(kind))
        return first

    @property
    def x(self) -> float:
        return self.seen(PoseReport)[-1].pose.x


async def test_it_reports_its_pose_and_navigation_at_the_start() -> None:
    ride = Ride(charge=40)

    await ride.driver.start()

    assert ride.events == [
        PoseReport(Pose(1.0, 0.0, 0.0, "m"), localized=True, vx=0.0, omega=0.0),
        BatteryReport(state_of_charge=40.0, charging=False),
        NavigationReport(available=True, reason=""),
    ]


async def test_it_drives_to_its_goal_and_reports_poses() -> None:
    ride = Ride()
    ride.go(3, 21.0)

    assert await ride.wait_for(Arrived) == Arrived(3)

    places = [report.pose.x for report in ride.seen(PoseReport)]
    assert places == sorted(places)
    assert places[-1] == 21.0
    assert any(report.vx == 20.0 for report in ride.seen(PoseReport))
    assert ride.seen(PoseReport)[-1].vx == 0.0


async def test_a_new_goal_replaces_the_old_one_without_an_event() -> None:
    ride = Ride()
    ride.go(1, 100.0)
    await ride.wait_for(PoseReport)
    ride.go(2, 2.0)

    await ride.wait_for(Arrived)

    assert ride.seen(Arrived) == [Arrived(2)]
    assert not ride.seen(Halted)


async def test_a_halt_stops_the_robot_at_once() -> None:
    ride = Ride()
    ride.go(1, 1000.0)
    await until(lambda: ride.seen(PoseReport) and ride.x > 1.1)

    ride.driver.halt()
    await ride.wait_for(Halted)

    assert 1.1 < ride.x < 1000.0
    assert not ride.seen(Arrived)


async def test_a_halt_at_standstill_is_answered() -> None:
    ride = Ride()
    ride.driver.halt()

    await ride.wait_for(Halted)


async def test_a_lower_speed_of_the_goal_is_kept() -> None:
    ride = Ride()
    ride.driver.go_to(DriveGoal(1, Pose(2.0, 0.0, 0.0, "m"), 0.3, maximum_speed=5.0))

    await ride.wait_for(Arrived)

    assert {report.vx for report in ride.seen(PoseReport)} <= {0.0, 5.0}


async def test_a_goal_on_another_map_fails() -> None:
    ride = Ride()
    ride.go(1, 2.0, map_id="cellar")

    failed = await ride.wait_for(DriveFailed)

    assert failed.generation == 1
    assert "cellar" in failed.description


async def test_it_accepts_its_initial_position() -> None:
    ride = Ride()
    ride.driver.initialize_position(Pose(7.0, 8.0, 1.0, "m"))

    assert (await ride.wait_for(PositionInitialized)).succeeded
    assert ride.seen(PoseReport)[-1].pose == Pose(7.0, 8.0, 1.0, "m")


async def test_driving_uses_battery_charge() -> None:
    ride = Ride(charge=50, drain=100, speed=200.0)
    ride.go(1, 11.0)
    await ride.wait_for(Arrived)

    levels = [report.state_of_charge for report in ride.seen(BatteryReport)]
    assert levels
    assert levels == sorted(levels, reverse=True)
    assert 40.0 <= levels[-1] < 50.0


async def test_a_stopped_driver_sends_no_events() -> None:
    ride = Ride()
    ride.go(1, 100.0)
    await ride.driver.stop()
    ride.events.clear()

    other = Ride()
    other.go(1, 3.0)
    await other.wait_for(Arrived)

    assert ride.events == []


async def test_with_a_deceleration_a_halt_needs_braking_distance() -> None:
    ride = Ride(deceleration=20.0)  # which takes a second, and 10 m
    ride.go(1, 1000.0)
    await until(lambda: ride.seen(PoseReport) and ride.x > 1.1)

    ride.driver.halt()
    begin = ride.x
    ride.driver.halt()  # asked twice, it answers once
    await ride.wait_for(Halted)

    assert 9.0 < ride.x - begin < 13.0
    speeds = [report.vx for report in ride.seen(PoseReport)]
    assert any(speed is not None and 0 < speed < 20.0 for speed in speeds)
    assert speeds[-1] == 0.0
    assert len(ride.seen(Halted)) == 1


async def test_an_emergency_stop_ends_braking_and_confirms_the_halt() -> None:
    ride = Ride(deceleration=1.0)
    ride.go(1, 1000.0)
    await until(lambda: ride.seen(PoseReport) and ride.x > 1.1)
    ride.driver.halt()
    assert not ride.seen(Halted)

    ride.driver.stop_at_once()

    assert ride.events[-1] == Halted()
    assert ride.seen(PoseReport)[-1].vx == 0.0


async def test_a_goal_in_an_unreachable_circle_also_fails_while_driving() -> None:
    ride, circle = Ride(), Circle(100.0, 0.0, 0.5)
    ride.go(1, 100.0)
    ride.driver.set_unreachable(circle, active=True)
    assert (await ride.wait_for(DriveFailed)).generation == 1

    ride.go(2, 3.0)
    assert await ride.wait_for(Arrived) == Arrived(2)
    ride.driver.set_unreachable(circle, active=False)
    ride.go(3, 100.0)
    await until(lambda: ride.x > 4.0)
    assert len(ride.seen(DriveFailed)) == 1
    await ride.driver.stop()


async def test_moved_during_a_drive_it_continues_from_there() -> None:
    ride = Ride()
    ride.go(1, 1000.0)
    ride.driver.carry_to(998.0, 0.0, 0.0)

    assert await ride.wait_for(Arrived) == Arrived(1)
    assert ride.x == 1000.0


async def test_a_new_speed_applies_to_the_current_goal() -> None:
    ride = Ride(speed=0.001)
    ride.go(1, 3.0)
    ride.driver.set_speed(50.0)

    assert await ride.wait_for(Arrived) == Arrived(1)


async def test_charging_is_reported_until_the_battery_is_full() -> None:
    ride = Ride(charge=98, charge_rate=100)
    ride.driver.set_charging(charging=True)

    await until(lambda: ride.seen(BatteryReport)[-1].state_of_charge == 100.0)
    assert all(report.charging for report in ride.seen(BatteryReport))
    ride.go(1, 2.0)
    await ride.wait_for(Arrived)
    assert not ride.seen(BatteryReport)[-1].charging


async def test_without_navigation_it_does_not_drive() -> None:
    ride = Ride()
    ride.go(1, 1000.0)
    ride.driver.set_navigation(available=False, reason="gone")

    assert ride.events[-1] == NavigationReport(available=False, reason="gone")
    assert ride.seen(PoseReport)[-1].vx == 0.0


async def test_the_pose_is_known_after_a_position_is_set() -> None:
    ride = Ride()
    ride.driver.set_localized(localized=False)
    assert not ride.seen(PoseReport)[-1].localized

    ride.driver.initialize_position(Pose(7.0, 8.0, 1.0, "m"))
    await ride.wait_for(PositionInitialized)
    assert ride.seen(PoseReport)[-1].localized


STEPS = st.lists(
    st.tuples(st.sampled_from(["drive", "on", "off", "wait", "set"]), st.floats(0, 1000)), max_size=20
)


def battery(**settings: float) -> SimulatedBattery:
    return SimulatedBattery(LoopbackSettings.model_validate(settings))


def test_driving_drains_the_battery() -> None:
    one = battery(charge=50, drain=2)
    one.drain_by(300)

    assert one.level_at(0.0) == 44
    one.drain_by(10_000)
    assert one.level_at(0.0) == 0


def test_charging_increases_the_charge_until_full() -> None:
    one = battery(charge=50, charge_rate=2)
    one.switch_charging(10.0, charging=True)

    assert one.is_charging
    assert (one.level_at(15.0), one.level_at(15.0)) == (60, 60)
    assert one.level_at(100.0) == 100
    one.switch_charging(100.0, charging=False)
    one.drain_by(100)
    assert one.level_at(200.0) == 99


def test_a_set_charge_is_the_new_level() -> None:
    one = battery(charge=50, charge_rate=1)
    one.switch_charging(0.0, charging=True)
    one.set_level(10.0, 5)

    assert one.level_at(12.0) == pytest.approx(7)


@given(STEPS)
def test_its_charge_stays_between_0_and_100_percent(steps: list[tuple[str, float]]) -> None:
    one, now = battery(), 0.0
    for kind, value in steps:
        now += value
        match kind:
            case "drive":
                one.drain_by(value)
            case "on" | "off":
                one.switch_charging(now, charging=kind == "on")
            case "set":
                one.set_level(now, min(value, 100.0))
        assert 0 <= one.level_at(now) <= 100


METRES = st.floats(-100, 100)
POSES = st.builds(Pose, METRES, METRES, st.floats(-pi, pi), st.just("m"))


def motion(start: Pose, goal: Pose, *, turn_at_end: bool = True) -> Motion:
    return Motion(start=start, goal=goal, begin=10.0, speed=2.0, rate=1.0, turn_at_end=turn_at_end)


def test_it_turns_drives_and_turns() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(0, 4, pi, "m"))

    assert way.end == pytest.approx(10 + pi / 2 + 2 + pi / 2)
    pose, vx, omega = way.motion_at(10 + pi / 4)
    assert (pose.x, pose.y, pose.theta, vx, omega) == pytest.approx((0, 0, pi / 4, 0, 1))
    pose, vx, omega = way.motion_at(10 + pi / 2 + 1)
    assert (pose.x, pose.y, pose.theta, vx, omega) == pytest.approx((0, 2, pi / 2, 2, 0), abs=1e-9)
    pose, vx, omega = way.motion_at(10 + pi / 2 + 2 + pi / 4)
    assert (pose.y, pose.theta, vx, omega) == pytest.approx((4, 3 * pi / 4, 0, 1))


def test_without_a_theta_it_keeps_its_heading() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(4, 0, 2.0, "m"), turn_at_end=False)

    assert way.motion_at(way.end)[0].theta == 0.0
    assert way.end == 12.0


@given(POSES, POSES)
def test_a_motion_begins_at_its_start_and_ends_at_its_goal(start: Pose, goal: Pose) -> None:
    way = motion(start, goal)

    first, _, _ = way.motion_at(9.0)
    last, vx, omega = way.motion_at(way.end + 1.0)

    assert (first.x, first.y) == pytest.approx((start.x, start.y))
    assert (last.x, last.y, vx, omega) == (goal.x, goal.y, 0.0, 0.0)
    assert abs((last.theta - goal.theta + pi) % (2 * pi) - pi) < 1e-6


def test_it_brakes_evenly_to_a_standstill() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(100, 0, 0, "m"))
    stop = plan_braking(way, 20.0, 0.5)

    assert stop is not None
    assert stop.end == 24.0
    assert stop.motion_at(20.0)[:2] == (Pose(20, 0, 0, "m"), 2.0)
    pose, vx, _ = stop.motion_at(22.0)
    assert (pose.x, vx) == (23, 1)
    assert stop.motion_at(30.0) == (Pose(24, 0, 0, "m"), 0.0, 0.0)


def test_near_its_goal_it_brakes_harder_and_never_overshoots() -> None:
    way = motion(Pose(0, 0, 0, "m"), Pose(21, 0, 0, "m"))
    stop = plan_braking(way, 20.0, 0.5)

    assert stop is not None
    assert stop.motion_at(stop.end)[0].x == pytest.approx(21)


def test_without_a_deceleration_or_while_it_turns_it_stops_on_the_spot() -> None:
    ahead, aside = Pose(100, 0, 0, "m"), Pose(0, 100, 0, "m")

    assert plan_braking(motion(Pose(0, 0, 0, "m"), ahead), 20.0, 0.0) is None
    assert plan_braking(motion(Pose(0, 0, 0, "m"), aside), 10.5, 0.5) is None
