"""Robots of which nothing new is heard are asked for their states."""

from __future__ import annotations

from itertools import chain, count

import pytest

from nena_conversations.kit.honest_robot import ROBOT, HonestRobot
from nena_order_service.fleet.controller import RETAINED_WITHIN, FleetController
from nena_order_service.fleet.outputs import InstantActionEnded, PublishInstantActions
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.fleet_api.reasons import Reason
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.topics import RobotKey
from support.fleet import Bench, make_action, make_vda_order


def reconnect(bench: Bench, *, unread: bool = False) -> None:
    """Lose our own link for three seconds."""
    bench.set_broker(connected=False)
    bench.lose()
    bench.now += 3.0
    bench.set_broker(connected=True, unread=unread)


def asked(bench: Bench) -> int:
    return bench.instants_sent().count("stateRequest")


def expecting(*robots: RobotKey) -> Bench:
    """Return a bench whose plant model has these robots, at a broker that has told nothing of them yet."""
    bench, numbers = Bench(), count(1)
    bench.fleet = FleetController(FleetSettings(), expected=robots, new_id=lambda: f"id-{next(numbers)}")
    bench.set_broker(connected=True)
    return bench


def test_a_robot_of_the_plant_of_which_nothing_is_known_is_asked_once() -> None:
    bench = expecting(ROBOT)
    assert asked(bench) == 0, "its connection may be retained at the broker"
    bench.wait(RETAINED_WITHIN + 60.0)
    assert asked(bench) == 1
    assert bench.view().link is LinkStatus.UNKNOWN


def test_a_robot_without_a_state_is_asked_once_it_connects() -> None:
    bench = expecting(ROBOT)
    bench.connection(ConnectionState.ONLINE)
    bench.tick()
    assert asked(bench) == 1
    bench.exchange()
    bench.wait(60.0, reporting=True)
    assert asked(bench) == 1


@pytest.mark.parametrize(
    "state", [ConnectionState.OFFLINE, ConnectionState.CONNECTION_BROKEN, ConnectionState.HIBERNATING]
)
def test_a_robot_that_is_away_is_not_asked(state: ConnectionState) -> None:
    bench = expecting(ROBOT)
    bench.connection(state)
    bench.wait(60.0)
    assert asked(bench) == 0


def test_a_reconnected_robot_is_asked_at_each_connection() -> None:
    bench = Bench().online()
    for number in (1, 2):
        bench.now += 10.0
        bench.connection(ConnectionState.CONNECTION_BROKEN)
        bench.wait(1.0)
        bench.connection(ConnectionState.ONLINE)
        bench.wait(0.5)
        assert asked(bench) == number
        bench.report()


def test_a_repeated_connection_message_asks_nothing() -> None:
    """Brokers may deliver a message once for each of several subscriptions."""
    bench = expecting(ROBOT)
    message = bench.robot.connection(ConnectionState.ONLINE, bench.now)
    for _ in range(3):
        bench.take(bench.fleet.on_connection(ROBOT, message, bench.now))
        bench.tick()
    assert asked(bench) == 1
    bench.report()
    bench.take(bench.fleet.on_connection(ROBOT, message, bench.now))
    bench.wait(5.0)
    assert asked(bench) == 1
    assert bench.view().availability.can_take_order


@pytest.mark.parametrize("mode", ["INTERVENED", "MANUAL", "SEMIAUTOMATIC", "SERVICE"])
def test_a_robot_is_asked_in_each_mode_but_intervened(mode: str) -> None:
    bench = Bench().online()
    bench.robot.set_mode(OperatingMode(mode))
    bench.report()
    reconnect(bench)
    assert asked(bench) == (mode != "INTERVENED")
    bench.wait(10.0)
    assert bool(asked(bench)) is (mode != "INTERVENED")


def test_a_robot_that_never_answers_is_left_alone_in_the_end() -> None:
    bench = Bench().online()
    reconnect(bench)
    bench.wait(600.0)
    assert asked(bench) == bench.settings.sendings
    assert bench.tick() == ()


def test_a_new_leader_asks_a_robot_and_pauses_it_before_it_has_reported() -> None:
    bench = Bench().online()
    reconnect(bench, unread=True)
    bench.instruct(make_action("startPause", "p"))
    assert bench.instants_sent() == ["stateRequest", "startPause"]
    bench.exchange()
    assert bench.robot.paused
    assert bench.told(InstantActionEnded)[-1].status is ActionStatus.FINISHED


def test_a_new_leader_says_why_the_states_of_a_robot_are_unreadable() -> None:
    bench = Bench().online()
    reconnect(bench, unread=True)
    problem = Reason.of("sends states that are unreadable: nodeStates")
    tuple(bench.control.on_unreadable_state(problem, None, bench.now))
    assert bench.view().link is LinkStatus.UNREADABLE
    assert bench.view().availability.reason == problem


def test_a_robot_that_was_never_heard_can_be_paused() -> None:
    bench = expecting(ROBOT)
    bench.instruct(make_action("startPause", "p"))
    bench.deliver()
    assert bench.robot.paused


def test_all_robots_that_have_reported_are_asked_again_those_with_an_order_first() -> None:
    robots = [HonestRobot(key=RobotKey("Honest", f"r{number}")) for number in range(10)]
    fleet, now = FleetController(FleetSettings()), 100.0

    def tick() -> list[str]:
        outputs = chain.from_iterable(fleet.tick(now))
        return [each.robot.serial_number for each in outputs if isinstance(each, PublishInstantActions)]

    fleet.on_broker(connected=True, now=now)
    for robot in robots:
        fleet.on_factsheet(robot.key, robot.factsheet(), now)
        fleet.on_connection(robot.key, robot.connection(ConnectionState.ONLINE, now), now)
        fleet.on_state(robot.key, robot.state(now), now)
    tuple(fleet.control(robots[-1].key).start_order(make_vda_order("m", "A", "B"), now))
    assert tick() == []

    fleet.on_broker(connected=False, now=now)
    fleet.on_broker(connected=True, now=now)
    assert tick() == ["r9", *(f"r{number}" for number in range(9))]
    assert tick() == []
