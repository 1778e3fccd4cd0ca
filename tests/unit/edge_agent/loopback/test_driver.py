from __future__ import annotations

from typing import TypeVar

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
from nena_edge_agent.loopback.driver import LoopbackDriver
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


async def test_at_its_start_it_tells_where_it_is_and_that_it_can_drive() -> None:
    ride = Ride(charge=40)

    await ride.driver.start()

    assert ride.events == [
        PoseReport(Pose(1.0, 0.0, 0.0, "m"), localized=True, vx=0.0, omega=0.0),
        BatteryReport(state_of_charge=40.0, charging=False),
        NavigationReport(available=True, reason=""),
    ]


async def test_it_drives_to_its_goal_and_tells_poses_on_the_way() -> None:
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


async def test_a_halt_stops_it_where_it_is() -> None:
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


async def test_a_lower_speed_of_the_goal_is_obeyed() -> None:
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


async def test_it_is_where_it_is_told_to_be() -> None:
    ride = Ride()
    ride.driver.initialize_position(Pose(7.0, 8.0, 1.0, "m"))

    assert (await ride.wait_for(PositionInitialized)).succeeded
    assert ride.seen(PoseReport)[-1].pose == Pose(7.0, 8.0, 1.0, "m")


async def test_driving_takes_charge() -> None:
    ride = Ride(charge=50, drain=100, speed=200.0)
    ride.go(1, 11.0)
    await ride.wait_for(Arrived)

    levels = [report.state_of_charge for report in ride.seen(BatteryReport)]
    assert levels
    assert levels == sorted(levels, reverse=True)
    assert 40.0 <= levels[-1] < 50.0


async def test_after_its_end_it_is_silent() -> None:
    ride = Ride()
    ride.go(1, 100.0)
    await ride.driver.stop()
    ride.events.clear()

    other = Ride()
    other.go(1, 3.0)
    await other.wait_for(Arrived)

    assert ride.events == []


async def test_with_a_deceleration_a_halt_takes_its_way() -> None:
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


async def test_an_emergency_stop_while_it_brakes_is_at_once_and_answers_the_halt() -> None:
    ride = Ride(deceleration=1.0)
    ride.go(1, 1000.0)
    await until(lambda: ride.seen(PoseReport) and ride.x > 1.1)
    ride.driver.halt()
    assert not ride.seen(Halted)

    ride.driver.stop_at_once()

    assert ride.events[-1] == Halted()
    assert ride.seen(PoseReport)[-1].vx == 0.0


async def test_a_goal_in_a_circle_that_cannot_be_reached_fails_also_on_the_way() -> None:
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


async def test_carried_away_on_its_way_it_drives_to_its_goal_from_there() -> None:
    ride = Ride()
    ride.go(1, 1000.0)
    ride.driver.carry_to(998.0, 0.0, 0.0)

    assert await ride.wait_for(Arrived) == Arrived(1)
    assert ride.x == 1000.0


async def test_a_speed_that_is_set_holds_for_the_goal_that_it_drives_to() -> None:
    ride = Ride(speed=0.001)
    ride.go(1, 3.0)
    ride.driver.set_speed(50.0)

    assert await ride.wait_for(Arrived) == Arrived(1)


async def test_charging_is_told_as_it_goes_on_until_the_battery_is_full() -> None:
    ride = Ride(charge=98, charge_rate=100)
    ride.driver.set_charging(charging=True)

    await until(lambda: ride.seen(BatteryReport)[-1].state_of_charge == 100.0)
    assert all(report.charging for report in ride.seen(BatteryReport))
    ride.go(1, 2.0)
    await ride.wait_for(Arrived)
    assert not ride.seen(BatteryReport)[-1].charging


async def test_without_navigation_it_stands() -> None:
    ride = Ride()
    ride.go(1, 1000.0)
    ride.driver.set_navigation(available=False, reason="gone")

    assert ride.events[-1] == NavigationReport(available=False, reason="gone")
    assert ride.seen(PoseReport)[-1].vx == 0.0


async def test_a_position_that_is_set_is_known_again() -> None:
    ride = Ride()
    ride.driver.set_localized(localized=False)
    assert not ride.seen(PoseReport)[-1].localized

    ride.driver.initialize_position(Pose(7.0, 8.0, 1.0, "m"))
    await ride.wait_for(PositionInitialized)
    assert ride.seen(PoseReport)[-1].localized
