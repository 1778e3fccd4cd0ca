"""Docking and Nav2's behaviours as actions of an order, over real DDS."""

from __future__ import annotations

import math
from typing import Any

import pytest
from action_msgs.srv import CancelGoal

from support.action_types import needs_nav2_types
from support.edge_agent import FleetControl, status_of
from support.nav2_agent import Bench, ready
from support.robot_core import action, order, position
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]

OPERATIONS: list[dict[str, Any]] = [
    {"kind": "nav2", "action_type": "startCharging", "behavior": "dock", "dock_id": "dock", "charging": True},
    {"kind": "nav2", "action_type": "stopCharging", "behavior": "undock", "charging": False},
    {"kind": "nav2", "action_type": "turn", "behavior": "spin"},
    {"kind": "nav2", "action_type": "back", "behavior": "back_up", "speed": 0.5, "maximum": 20.0},
    {"kind": "nav2", "action_type": "ahead", "behavior": "drive_on_heading", "speed": 0.5},
]


def at_n1(action_id: str, action_type: str, **parameters: Any) -> Any:
    """Return an order with one action at a node that the robot drives to."""
    work = action(action_id, "HARD", action_type, retriable=None, **parameters)
    return order("n0", "n1", positions={"n1": position(2.0)}, node_actions={"n1": [work]}, order_id=action_id)


async def done(fleet: FleetControl, action_id: str) -> dict[str, Any]:
    return await fleet.state(lambda state: status_of(state, action_id) in ("FINISHED", "FAILED"))


def result_of(state: dict[str, Any], action_id: str) -> str:
    (found,) = (each for each in state["actionStates"] if each["actionId"] == action_id)
    return str(found.get("resultDescription", ""))


async def test_a_robot_docks_charges_and_leaves_the_dock(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("in", "startCharging"))
            state = await done(fleet, "in")
            assert status_of(state, "in") == "FINISHED"
            await fleet.state(lambda state: state["batteryState"]["charging"])
            await until(lambda: max(bench.places, default=0.0) > 2.15, what="the robot in the dock")
            stands = bench.places[-1]

            place = {"n1": position(2.0), "n2": position(2.0, 2.0)}
            out = action("out", "HARD", "stopCharging", retriable=None)
            fleet.send(order("n1", "n2", positions=place, node_actions={"n1": [out]}, order_id="o2"))
            state = await done(fleet, "out")
            assert status_of(state, "out") == "FINISHED"
            await until(lambda: min(bench.places[-5:]) < stands, what="the robot out of the dock")


async def test_unknown_dock_fails_with_the_reason(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("in", "startCharging", dockId="nowhere"))
            state = await done(fleet, "in")
            assert status_of(state, "in") == "FAILED"
            assert "does not know this dock (error code 901)" in result_of(state, "in")
            assert "name a dock of its database" in result_of(state, "in")


async def test_spin_turns_on_the_spot(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0):  # faster, a pause of the simulator turns it too far
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("turn", "turn", angle=math.pi / 2))
            state = await done(fleet, "turn")
            assert status_of(state, "turn") == "FINISHED"
            assert abs(state["agvPosition"]["theta"] - math.pi / 2) < 0.4
            assert abs(state["agvPosition"]["x"] - 2.0) < 0.5


async def test_drive_on_heading_drives_straight(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("ahead", "ahead", distance=1.0))
            state = await done(fleet, "ahead")
            assert status_of(state, "ahead") == "FINISHED"
            await until(lambda: bench.places[-1] > 2.6, what="the robot a metre ahead")


async def test_assisted_teleop_is_ended(bench: Bench) -> None:
    """As docs/actions.md has it, by the cancel service of Nav2's action."""
    asked: list[CancelGoal.Request] = []

    def cancel(request: CancelGoal.Request, response: CancelGoal.Response) -> CancelGoal.Response:
        asked.append(request)
        return response

    name = "assisted_teleop/_action/cancel_goal"
    bench.ros.node.create_service(CancelGoal, name, cancel)
    call = {"service": name, "type": "action_msgs/srv/CancelGoal", "expect": {"return_code": 0}}
    off = {"kind": "service", "action_type": "assistedTeleopOff", "call": call}
    with bench.simulator():
        async with bench.agent(operations=[off]) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("off", "assistedTeleopOff"))
            state = await done(fleet, "off")
            assert (status_of(state, "off"), len(asked)) == ("FINISHED", 1)


async def test_cancelled_order_stops_a_behavior(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0):
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("back", "back", distance=15.0))
            await fleet.state(lambda state: status_of(state, "back") == "RUNNING")
            await until(lambda: bench.speed > 0.3, what="the robot on its way back")
            fleet.instant(action("c", "NONE", "cancelOrder", retriable=None))
            state = await fleet.state(lambda state: status_of(state, "c") == "FINISHED")
            assert status_of(state, "back") == "FAILED"
            await until(lambda: bench.speed == 0.0, what="standstill")
            assert bench.places[-1] > -5.0


async def test_excessive_distance_is_rejected_before_the_robot_drives(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent(operations=OPERATIONS) as fleet:
            await fleet.state(ready)
            fleet.send(at_n1("ahead", "ahead", distance=50.0))
            await fleet.state(
                lambda state: any("at most" in each["errorDescription"] for each in state["errors"])
            )
