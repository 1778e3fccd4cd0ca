"""Servers of Nav2 that die or hang alone: the robot stops, or the state reports that it does not."""

from __future__ import annotations

from typing import Any

import pytest
from nav_msgs.srv import GetMap
from std_msgs.msg import String

from nena_edge_agent.driver.port import STANDING
from support.action_types import needs_action_types
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import ROS, Bench, failure_of, ready
from support.robot_core import action, order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

BY_BOTH = pytest.mark.parametrize("navigation", ["topics", pytest.param("action", marks=needs_action_types)])
SOON = {"goals": {**ROS["goals"], "standstill_timeout": 1.0}, "call_timeout": 0.5}
NAVIGATOR_FAULTS = pytest.mark.parametrize("fault", ["server_died", "server_hung"])
LONG_WAY = order("n0", "n3")
HANGING = 0.7
"""Seconds for which a navigator is only busy."""
LET_DRIVE = 3.0
"""Metres that a robot at 1 m/s drives without its navigator at most; its bond breaks after 4 s."""
PERIOD = 0.05
"""Seconds between two messages of the odometry."""


def stands(bench: Bench) -> bool:
    return bench.speed == 0.0


async def the_robot_stands(bench: Bench, before: float = 29.0) -> None:
    """Wait until the robot is at standstill, and check that it stopped before the end of its path."""
    await until(lambda: stands(bench), what="the robot at rest")
    assert bench.places[-1] < before, "the controller has driven its path to the end"


@BY_BOTH
async def test_robot_is_stopped_when_its_navigator_dies(bench: Bench, navigation: str) -> None:
    async with bench.robot(time_factor=2.0, ros={"navigation": navigation}) as fleet:
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault("server_died", server="bt_navigator")
        state = await fleet.state(lambda state: "(NAVIGATION_GONE)" in str(state["errors"]))
        assert state["driving"], "it rolls out"
        await the_robot_stands(bench)
        await until(lambda: not fleet.states[-1]["driving"], what="word that it stands")
        assert fleet.states[-1]["velocity"]["vx"] < STANDING


@needs_action_types
@BY_BOTH
async def test_robot_is_stopped_when_its_navigator_sends_no_feedback(bench: Bench, navigation: str) -> None:
    async with bench.robot(time_factor=1.0, ros={"navigation": navigation}) as fleet:
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault("server_hung", server="bt_navigator")
        hung_at = bench.places[-1]
        await fleet.state(lambda state: "(NAVIGATION_GONE)" in str(state["errors"]))
        await the_robot_stands(bench, before=hung_at + LET_DRIVE)


@needs_action_types
async def test_navigator_hanging_for_less_than_a_second_fails_no_drive(bench: Bench) -> None:
    async with bench.robot(time_factor=1.0, ros={"navigation": "action"}) as fleet:
        fleet.send(order("n0", "n1"))
        await bench.moves()
        bench.fault("server_hung", server="bt_navigator")
        seen = len(bench.odometry)
        await until(lambda: len(bench.odometry) >= seen + HANGING / PERIOD, what="the end of the hanging")
        bench.fault("server_hung", server="bt_navigator", active=False)
        done = await fleet.state(ended("o1"))
        assert (done["lastNodeId"], error_types(done)) == ("n1", [])
    assert all(failure_of(state) is None for state in fleet.states)


@BY_BOTH
@NAVIGATOR_FAULTS
@pytest.mark.parametrize("request_type", [pytest.param("cancelOrder", marks=pytest.mark.long), "startPause"])
async def test_stop_without_a_navigator_finishes_when_the_robot_has_stopped(
    bench: Bench, navigation: str, fault: str, request_type: str
) -> None:
    async with bench.robot(time_factor=2.0, ros={"navigation": navigation}) as fleet:
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault(fault, server="bt_navigator")
        fleet.instant(action("a", "NONE", request_type))
        state = await fleet.state(lambda state: status_of(state, "a") in ("FINISHED", "FAILED"))
        assert status_of(state, "a") == "FINISHED"
        assert await bench.speed_at(state) == 0.0
        assert not state["driving"]
        await the_robot_stands(bench)


@NAVIGATOR_FAULTS
async def test_robot_that_does_not_stop_is_reported_as_driving_and_needs_help(
    bench: Bench, fault: str
) -> None:
    async with bench.robot(time_factor=2.0, ros=SOON) as fleet:
        bench.fault("controller_deaf")
        fleet.send(LONG_WAY)
        await bench.moves()
        bench.fault(fault, server="bt_navigator")
        fleet.instant(action("c", "NONE", "cancelOrder"))
        state = await fleet.state(lambda state: status_of(state, "c") in ("FINISHED", "FAILED"))
        assert status_of(state, "c") == "FAILED"
        assert state["driving"]
        (error,) = (each for each in state["errors"] if each["errorType"] == "ROBOT_NOT_STOPPED")
        assert error["errorLevel"] == "FATAL"
        assert "emergency stop" in str(error)
        await until(lambda: not fleet.states[-1]["driving"], what="word that it stands at last")
        last = fleet.states[-1]
        assert (last["nodeStates"], status_of(last, "c")) == ([], "FAILED")
        assert "ROBOT_NOT_STOPPED" not in error_types(last)


async def test_robot_moved_by_someone_is_driving(bench: Bench) -> None:
    async with bench.robot(time_factor=2.0) as fleet:
        bench.fault("foreign_goal", x=20.0, y=0.0)
        await fleet.state(lambda state: state["driving"] and state.get("velocity", {}).get("vx", 0.0) > 0.1)


@BY_BOTH
async def test_an_order_waits_for_the_bring_up_of_nav2(bench: Bench, navigation: str) -> None:
    quick: dict[str, Any] = {"goals": {**ROS["goals"], "confirmation_time": 0.3}, "call_timeout": 0.2}
    with bench.simulator("--faults", '[{"kind": "bring_up"}]'):
        async with bench.agent(ros={"navigation": navigation, **quick}) as fleet:
            faults = bench.ros.publisher(String, "simulator/fault")
            bench.ros.call(bench.ros.client(GetMap, "map_server/map"), GetMap.Request())  # it has heard of it
            await fleet.state(lambda state: "Nav2 is starting" in str(state["errors"]))
            fleet.send(order("n0", "n1"))
            await fleet.state(lambda state: state["orderId"] == "o1")
            faults.publish(String(data='{"kind": "bring_up", "active": false}'))
            done = await fleet.state(ended("o1"))
            assert error_types(done) == []
        assert all(failure_of(state) is None for state in fleet.states)


@BY_BOTH
async def test_late_handovers_during_replanning_fail_nothing(bench: Bench, navigation: str) -> None:
    """A goal sent 0.3 m before a node succeeds where the old path ends, 0.65 m before its own node."""
    near = {"strategy": "pass_through", "pass_radius": 0.3, "deviation_xy": 0.5}
    positions = {f"n{index}": position(x) for index, x in enumerate((0.0, 1.5, 1.9, 3.4, 3.8))}
    measured = {"speed": 0.5, "acceleration": 2.5, "approach": 0.6}
    with bench.simulator("--replan_period", "1.0", time_factor=1.0, drive=measured):
        async with bench.agent(ros={"navigation": navigation}, drive=near) as fleet:
            await fleet.state(ready)
            fleet.send(order(*positions, positions=positions))
            done = await fleet.state(ended("o1"))
            assert (done["lastNodeId"], error_types(done)) == ("n4", [])
        assert all(failure_of(state) is None for state in fleet.states)
