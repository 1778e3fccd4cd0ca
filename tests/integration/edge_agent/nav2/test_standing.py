"""A robot that moves after its drive has ended: Nav2 succeeds at speed, or a base without its controller."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.driver.port import STANDING
from support.action_types import needs_action_types
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import ROS, Bench, ready
from support.robot_core import action, order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

BY_BOTH = pytest.mark.parametrize("navigation", ["topics", pytest.param("action", marks=needs_action_types)])
AT_SPEED: dict[str, Any] = {
    "drive": {"speed": 1.0, "acceleration": 0.5},
    "tolerance": {"xy": 0.4, "yaw": 0.3},
}
"""Nav2 succeeds at 0.6 m/s, and the robot stops 1.3 s later."""
WAY = {"n0": position(0.0), "n1": position(3.0, radius=1.0), "n2": position(6.0, radius=1.0)}
WORK = [
    {"action_type": "pick", "seconds": 0.2, "load": "take"},
    {"action_type": "scan", "seconds": 0.2, "scopes": ["NODE", "EDGE", "INSTANT"]},
]
SOON: dict[str, Any] = {"goals": {**ROS["goals"], "standstill_timeout": 1.0}, "call_timeout": 0.5}
NO_TIMEOUT: dict[str, Any] = {"drive": {"speed": 0.5, "acceleration": 2.5, "command_timeout": 0}}
"""The base keeps the last command of a dead controller. Nav2 aborts with code 0 some seconds later."""
WORKS = ("INITIALIZING", "RUNNING", "FINISHED")


async def check_that_it_stood(bench: Bench, action_id: str) -> None:
    """Check that the robot stood whenever its state reported the action as begun."""
    begun = [state for state in bench.fleet.states if status_of(state, action_id) in WORKS]
    assert begun
    assert not any(state["driving"] for state in begun if status_of(state, action_id) != "FINISHED")
    assert await bench.speed_at(begun[0]) < STANDING


@BY_BOTH
@pytest.mark.clause("6.2.2", "6.6.2/blocking")
@pytest.mark.parametrize(
    ("strategy", "blocking"), [("stop_at_nodes", "HARD"), ("pass_through", "HARD"), ("pass_through", "SOFT")]
)
async def test_blocking_actions_start_when_the_robot_stands(
    bench: Bench, navigation: str, strategy: str, blocking: str
) -> None:
    drive = {"strategy": strategy}
    with bench.simulator(time_factor=1.0, **AT_SPEED):
        async with bench.agent(ros={"navigation": navigation}, drive=drive, operations=WORK) as fleet:
            await fleet.state(ready)
            on_node = {"n1": [action("a", blocking, "pick")]}
            on_edge = {"n1-n2": [action("e", blocking, "scan")]}
            fleet.send(order(*WAY, positions=WAY, node_actions=on_node, edge_actions=on_edge))
            done = await fleet.state(ended("o1"))
            assert [status_of(done, each) for each in "ae"] == ["FINISHED", "FINISHED"]
            assert error_types(done) == []
            for each in "ae":
                await check_that_it_stood(bench, each)
            rolls = [
                state
                for state in fleet.states
                if state["lastNodeId"] == "n1" and status_of(state, "a") == "WAITING"
            ]
            assert any(state["driving"] for state in rolls), "Nav2 had succeeded at speed"


@pytest.mark.clause("6.2.1/blocking")
async def test_instant_actions_that_block_driving_interrupt_the_drive(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0, **AT_SPEED):
        async with bench.agent(operations=WORK) as fleet:
            await fleet.state(ready)
            fleet.send(order(*WAY, positions=WAY))
            await bench.moves()
            fleet.instant(action("i", "HARD", "scan"))
            await fleet.state(lambda state: status_of(state, "i") == "FINISHED")
            await check_that_it_stood(bench, "i")
            done = await fleet.state(ended("o1"))
            assert (done["lastNodeId"], error_types(done)) == ("n2", [])


@pytest.mark.clause("6.6.9")
async def test_blocking_actions_fail_if_the_robot_does_not_stop(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0, **NO_TIMEOUT):
        async with bench.agent(ros=SOON, operations=WORK) as fleet:
            await fleet.state(ready)
            bench.fault("foreign_goal", x=20.0, y=0.0)
            await until(lambda: bench.speed > 0.45, what="the robot on its way")
            bench.fault("server_died", server="controller_server")
            await fleet.state(lambda state: "MOVES_WITHOUT_ORDER" in error_types(state))
            fleet.instant(action("i", "HARD", "scan"))
            state = await fleet.state(lambda state: status_of(state, "i") in ("FINISHED", "FAILED"))
            assert status_of(state, "i") == "FAILED"
            assert "0.50 m/s" in str(state["actionStates"])


@BY_BOTH
@pytest.mark.clause("6.1.3", "6.2.3/startPause")
@pytest.mark.parametrize("kind", ["cancelOrder", "startPause"])
async def test_stops_fail_if_the_base_drives_on_without_its_controller(
    bench: Bench, navigation: str, kind: str
) -> None:
    with bench.simulator(time_factor=1.0, **NO_TIMEOUT):
        async with bench.agent(ros={**SOON, "navigation": navigation}) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n5"))
            await until(lambda: bench.speed > 0.45, what="the robot on its way")
            bench.fault("server_died", server="controller_server")
            failed = await fleet.state(
                lambda state: {"DRIVE_RETRIED", "ROBOT_NOT_STOPPED"} & {*error_types(state)}
            )
            assert failed["driving"]
            fleet.instant(action("c", "NONE", kind))
            state = await fleet.state(lambda state: status_of(state, "c") in ("FINISHED", "FAILED"))
            assert (status_of(state, "c"), state["driving"]) == ("FAILED", True)
            seen = len(bench.odometry)
            await until(lambda: len(bench.odometry) > seen + 40, what="two more seconds of movement")
            (error,) = (e for e in fleet.states[-1]["errors"] if e["errorType"] == "ROBOT_NOT_STOPPED")
            assert error["errorLevel"] == "FATAL"
            assert bench.speed > 0.45
            bench.fault("stuck")  # a person has pressed the emergency stop
            await until(lambda: not fleet.states[-1]["driving"], what="word that it stands")
            last = fleet.states[-1]
            assert "ROBOT_NOT_STOPPED" not in error_types(last)
            assert bool(last["nodeStates"]) is (kind == "startPause")
            assert not any(status_of(each, "c") == "FINISHED" for each in fleet.states)


async def test_robot_that_moves_without_an_order_asks_for_a_person(bench: Bench) -> None:
    """An operator's drive loses its controller: nothing drives the robot, and it moves."""
    with bench.simulator(time_factor=1.0, **NO_TIMEOUT):
        async with bench.agent(ros=SOON) as fleet:
            await fleet.state(ready)
            bench.fault("foreign_goal", x=20.0, y=0.0)
            await until(lambda: bench.speed > 0.45, what="the robot on its way")
            driven = len(fleet.states)
            bench.fault("server_died", server="controller_server")
            state = await fleet.state(lambda state: "MOVES_WITHOUT_ORDER" in error_types(state))
            assert state["driving"]
            assert not any("MOVES_WITHOUT_ORDER" in error_types(each) for each in fleet.states[:driven])
            fleet.instant(action("p", "NONE", "startPause"))
            await fleet.state(lambda state: status_of(state, "p") == "FAILED")
            bench.fault("stuck")
            await until(lambda: not fleet.states[-1]["driving"], what="word that it stands")
            assert {"MOVES_WITHOUT_ORDER", "ROBOT_NOT_STOPPED"}.isdisjoint(error_types(fleet.states[-1]))
