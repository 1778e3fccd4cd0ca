"""Why a robot stands still or a drive has failed: Nav2's codes, its recoveries, and the collision monitor."""

from __future__ import annotations

from typing import Any

import pytest

from support.action_types import needs_nav2_types
from support.nav2_agent import Bench, ready
from support.robot_core import order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]


def entry(state: dict[str, Any], error_type: str) -> dict[str, Any]:
    found = (each for each in state["errors"] if each["errorType"] == error_type)
    return next(found, {})


async def test_failed_drive_reports_nav2s_error_code_and_a_hint(bench: Bench) -> None:
    async with bench.robot() as fleet:
        fleet.send(order("n0", "n1", positions={"n1": position(1000.0)}))
        state = await fleet.state(lambda state: entry(state, "nodeUnreachable"))
    told = entry(state, "nodeUnreachable")
    references = {each["referenceKey"]: each["referenceValue"] for each in told["errorReferences"]}
    assert references["errorCode"] == "204"
    assert "outside of the map" in told["errorDescription"]
    assert told["errorHint"] == "compare the plant model with the robot's map"


async def test_recoveries_are_reported_while_they_run(bench: Bench) -> None:
    with bench.simulator("--recovery_time", "8", time_factor=1.0):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            bench.fault("unreachable")
            fleet.send(order("n0", "n1", positions={"n1": position(5.0)}))
            state = await fleet.state(lambda state: entry(state, "DRIVE_RECOVERS"))
            assert "'n1'" in entry(state, "DRIVE_RECOVERS")["errorDescription"]
            failed = await fleet.state(lambda state: entry(state, "nodeUnreachable"))
    assert "no path leads to the goal" in entry(failed, "nodeUnreachable")["errorDescription"]
    assert not entry(failed, "DRIVE_RECOVERS")


async def test_agent_that_starts_during_a_collision_stop_says_that_it_cannot_know(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1", positions={"n1": position(20.0)}))
            await bench.moves()
            bench.fault("collision_stop", polygon="PolygonFront")
            await fleet.state(lambda state: entry(state, "COLLISION_STOP"))
        before = len(fleet.states)
        async with bench.agent() as fleet:
            await until(lambda: any(map(unknown_stop, fleet.states[before:])), what="word of the unknown")
            assert not any(entry(state, "COLLISION_STOP") for state in fleet.states[before:])
            bench.fault("collision_stop", polygon="PolygonRear")
            state = await fleet.state(lambda state: "'PolygonRear'" in str(entry(state, "COLLISION_STOP")))
            assert not unknown_stop(state)
            bench.fault("collision_stop", active=False)
            await bench.moves()
            assert not unknown_stop(fleet.states[-1])


def unknown_stop(state: dict[str, Any]) -> bool:
    return any(each["infoType"] == "collisionMonitor" for each in state["information"])


async def test_collision_monitor_stop_is_reported_as_the_reason(bench: Bench) -> None:
    async with bench.robot(time_factor=1.0) as fleet:
        fleet.send(order("n0", "n1", positions={"n1": position(20.0)}))
        await bench.moves()
        bench.fault("collision_stop", polygon="PolygonFront")
        state = await fleet.state(lambda state: entry(state, "COLLISION_STOP"))
        assert "'PolygonFront'" in entry(state, "COLLISION_STOP")["errorDescription"]
        await until(lambda: bench.speed == 0.0, what="standstill")

        bench.fault("collision_stop", active=False)
        await bench.moves()
        await until(lambda: not entry(fleet.states[-1], "COLLISION_STOP"), what="no error")
