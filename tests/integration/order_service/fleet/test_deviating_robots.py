"""Robots that deviate from the standard under fleet control, over a real broker."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest

from nena_conversations.kit.honest_robot import ROBOT
from nena_order_service.fleet.robot import LinkStatus
from nena_shared.mqtt import Outbound
from nena_shared.vda5050.repair import RepairKind
from nena_shared.vda5050.topics import Topic
from support.broker import Broker
from support.fleet import make_vda_order
from support.waiting import until
from support.wired_robot import QUICK, WiredFleet, WiredRobot

pytestmark = pytest.mark.broker

Change = Callable[[dict[str, Any]], object]


class DeviatingRobot(WiredRobot):
    """A robot whose states are changed before they are sent."""

    def __init__(self, broker: Broker, interface_name: str, change: Change) -> None:
        super().__init__(broker, interface_name)
        self.change = change

    def report(self) -> None:
        """Send the state as it should not be."""
        content = json.loads(self.codec.encode(self.robot.state(asyncio.get_running_loop().time())))
        self.change(content)
        payload = json.dumps(content).encode()
        self.link.publish(Outbound(self.scheme.of(self.robot.key, Topic.STATE), payload, keep=False))


def face_west(state: dict[str, Any]) -> None:
    state["agvPosition"]["theta"] = 3.142


def be_sloppy(state: dict[str, Any]) -> None:
    """Deviate in many ways at once."""
    face_west(state)
    state |= {"version": "v2.1", "timestamp": "", "velocity": {"vx": float("nan")}, "errors": None}
    state["batteryState"]["batteryCharge"] = 101.3
    state["operatingMode"] = state["operatingMode"].lower()
    for node in state["nodeStates"]:
        node["sequenceId"] = float(node["sequenceId"])


@pytest.mark.parametrize("change", [face_west, be_sloppy])
async def test_a_robot_that_deviates_finishes_its_order(
    broker: Broker, interface_name: str, change: Change
) -> None:
    async with (
        WiredFleet(broker, interface_name).connected() as fleet,
        DeviatingRobot(broker, interface_name, change).connected() as robot,
    ):
        await until(lambda: fleet.fleet.view(ROBOT).availability.can_take_order, what="a free robot")
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B", operation="pick"))
        await fleet.wait_for("VdaOrderAccepted")
        for _ in range(3):
            robot.step()
        await fleet.wait_for("VdaOrderFinished")
        found = {(each.field, each.kind) for each in fleet.fleet.deviations.of(ROBOT)}
    assert ("state.agvPosition.theta", RepairKind.ANGLE_WRAPPED) in found
    assert sum(fleet.fleet.statistics.malformed.values()) == 0


async def test_a_robot_with_unreadable_messages_is_not_silent(broker: Broker, interface_name: str) -> None:
    def lose_order_id(state: dict[str, Any]) -> None:
        state["orderId"] = {"id": "m"}

    async with (
        WiredFleet(broker, interface_name, QUICK).connected() as fleet,
        DeviatingRobot(broker, interface_name, lose_order_id).connected() as robot,
    ):

        def reason() -> str:
            robot.report()
            return str(fleet.fleet.view(ROBOT).availability.reason)

        await until(lambda: "are unreadable" in reason(), what="a reason")
        assert reason() == (
            'sends states that are unreadable: orderId: Input should be a valid string (received {"id":"m"})'
        )
        await until(
            lambda: reason() and fleet.fleet.view(ROBOT).link is LinkStatus.UNREADABLE,
            what="the time after which a robot that sends nothing is silent",
        )
        assert "silent" not in reason()


async def test_without_readable_timestamps_an_old_state_is_recognised_by_its_header_id(
    broker: Broker, interface_name: str
) -> None:
    def lose_time(state: dict[str, Any]) -> None:
        state["timestamp"] = "yesterday"

    async with (
        WiredFleet(broker, interface_name).connected() as fleet,
        DeviatingRobot(broker, interface_name, lose_time).connected() as robot,
    ):
        topic = robot.scheme.of(robot.robot.key, Topic.STATE)

        def last_id() -> int:
            state = fleet.fleet.view(ROBOT).state
            return state.header_id if state else -1

        await until(lambda: last_id() >= 0, what="a state")
        content = json.loads(robot.codec.encode(robot.robot.state(asyncio.get_running_loop().time())))
        lose_time(content)

        def send(header_id: int) -> None:
            payload = json.dumps(content | {"headerId": header_id}).encode()
            robot.link.publish(Outbound(topic, payload, keep=False))

        send(1000)
        await until(lambda: last_id() == 1000, what="the newer state")
        received = fleet.mqtt.state.received
        send(999)
        await until(lambda: fleet.mqtt.state.received > received, what="the older state")
        assert last_id() == 1000
        send(1001)
        await until(lambda: last_id() == 1001, what="the newest state")
