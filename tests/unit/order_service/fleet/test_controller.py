"""Many robots under one fleet control."""

from __future__ import annotations

from nena_order_service.fleet import (
    FleetSettings,
    LinkStatus,
    MissionFinished,
    RobotChanged,
)
from nena_order_service.fleet.controller import RETAINED_WITHIN
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from support.fleet import Bench, make_mission
from support.honest_robot import ROBOT


def test_robots_do_not_touch_each_other() -> None:
    bench = Bench().online()
    bench.start(make_mission("m", "A", "B"))
    other = Bench()
    other.fleet = bench.fleet
    other.robot.key = type(ROBOT)("Honest", "robot-2")
    other.online()
    bench.run()
    assert bench.told(MissionFinished)
    assert other.view().mission_id is None
    assert other.robot.accepted == []


def other_robot(number: int) -> RobotKey:
    return RobotKey("Honest", f"other-{number}")


def test_only_so_many_robots_are_listened_to() -> None:
    bench = Bench(FleetSettings(robots_limit=2)).online()
    bench.fleet.on_malformed(other_robot(1))
    assert bench.fleet.robots() == (ROBOT, other_robot(1))
    assert bench.fleet.has_room_for(ROBOT)
    assert bench.fleet.has_room_for(other_robot(1))
    assert not bench.fleet.has_room_for(other_robot(2))


def test_looking_at_a_robot_does_not_make_it_known() -> None:
    bench = Bench()
    assert bench.fleet.view(other_robot(1), 0.0).link is LinkStatus.UNKNOWN
    assert bench.fleet.robots() == ()


def test_messages_that_cannot_be_read_are_counted_by_robot() -> None:
    bench = Bench().online()
    assert [bench.fleet.on_malformed(ROBOT) for _ in range(2)] == [1, 2]
    assert bench.fleet.on_malformed(other_robot(1)) == 1
    assert bench.view().malformed == 2


def test_all_are_known_when_each_that_the_broker_has_told_of_has_told_its_state() -> None:
    bench = Bench()
    bench.now += RETAINED_WITHIN
    assert not bench.fleet.all_known(bench.now), "there is no broker yet"
    bench.take(bench.fleet.on_broker(connected=True, now=bench.now))
    assert not bench.fleet.all_known(bench.now + RETAINED_WITHIN / 2), "it may have more to tell"
    bench.now += RETAINED_WITHIN
    assert bench.fleet.all_known(bench.now)

    bench.connection(ConnectionState.ONLINE)
    assert not bench.fleet.all_known(bench.now)
    bench.report()
    assert bench.fleet.all_known(bench.now)


def test_a_robot_that_is_away_is_not_waited_for() -> None:
    bench = Bench()
    bench.take(bench.fleet.on_broker(connected=True, now=bench.now))
    bench.connection(ConnectionState.OFFLINE)
    assert bench.fleet.all_known(bench.now + RETAINED_WITHIN)


def test_how_long_the_link_stands_is_counted_from_its_last_beginning() -> None:
    bench = Bench()
    assert bench.fleet.connected_for(50.0) == 0.0
    for connected, at, seconds in ((True, 100.0, 20.0), (False, 120.0, 0.0), (True, 130.0, 20.0)):
        bench.take(bench.fleet.on_broker(connected=connected, now=at))
        assert bench.fleet.connected_for(at + 20.0) == seconds


def test_a_tick_looks_at_those_who_have_something_to_do_and_at_those_who_fall_silent() -> None:
    bench = Bench().online()
    assert bench.tick() == ()
    bench.now += bench.settings.silent_after + 0.1
    assert bench.tick() == (RobotChanged(ROBOT),)
    assert bench.tick() == ()
    bench.report()
    bench.now += bench.settings.silent_after + 0.1
    assert bench.tick() == (RobotChanged(ROBOT),), "and anew once it was heard again"
