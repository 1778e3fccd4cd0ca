"""Robots that request a zone are granted it one after the other, over a real broker."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from nena_order_service.fleet.outputs import InstantActionEnded, VdaOrderFinished
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.topics import RobotKey, Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import MANUFACTURER, QUICK, FleetControl, agent_settings, running_agent
from support.robot_core import action, order
from support.schemas import schema_problems
from support.waiting import until
from support.wired_robot import PATIENT, WiredFleet
from support.zones import transfer, zone

pytestmark = [pytest.mark.broker, pytest.mark.clause("6.9", "6.4.3", "7.5")]

SERIALS = ("0001", "0002")
GATE = zone("gate", "RELEASE", 13, 17)


@pytest.fixture
async def peer(broker: Broker, interface_name: str) -> AsyncIterator[MqttPeer]:
    with MqttPeer(broker, f"{interface_name}/v3/+/+/+") as peer:
        yield peer


async def bring_gate(fleet: WiredFleet, peer: MqttPeer, interface_name: str, serial: str) -> None:
    """Send a robot the zone set: the order service sends none here."""
    robot = RobotKey(MANUFACTURER, serial)
    await until(lambda: fleet.fleet.view(robot).availability.can_take_order, what="a free robot")
    FleetControl(peer, interface_name, serial, version="3.0.0").publish(Topic.ZONE_SET, transfer(GATE))
    await until(
        lambda: (state := fleet.fleet.view(robot).state) is not None and bool(state.zone_sets),
        what="the zone set at the robot",
    )
    fleet.fleet.instant_action(robot, action(f"e-{serial}", "NONE", "enableZoneSet", zoneSetId="s1"))
    await until(
        lambda: any(
            isinstance(each, InstantActionEnded)
            and each.robot == robot
            and each.status is ActionStatus.FINISHED
            for each in fleet.news
        ),
        what="the zone set enabled",
    )


def grants(messages: list[Inbound], serial: str) -> list[str]:
    return [
        response["grantType"]
        for each in messages
        if each.topic.endswith(f"/{serial}/{Topic.RESPONSES}")
        for response in json.loads(each.payload)["responses"]
    ]


def most_inside(messages: list[Inbound]) -> int:
    """Count the robots that showed a release at the same time."""
    shown: dict[str, bool] = {}
    most = 0
    for each in messages:
        if each.topic.endswith(f"/{Topic.STATE}"):
            requests = json.loads(each.payload).get("zoneRequests", [])
            shown[each.topic] = any(one["requestStatus"] == "GRANTED" for one in requests)
            most = max(most, sum(shown.values()))
    return most


async def test_robots_are_admitted_to_a_zone_one_by_one(
    broker: Broker, interface_name: str, peer: MqttPeer, tmp_path: Path
) -> None:
    settings = PATIENT
    async with AsyncExitStack() as stack:
        fleet = await stack.enter_async_context(WiredFleet(broker, interface_name, settings).connected())
        for serial in SERIALS:
            agent = agent_settings(
                broker,
                interface_name,
                tmp_path / serial,
                version="3.0.0",
                serial_number=serial,
                loopback=QUICK | {"speed": 8.0},
            )
            await stack.enter_async_context(running_agent(agent))
            await bring_gate(fleet, peer, interface_name, serial)
        for serial in SERIALS:
            way = order("n0", "n1", "n2")
            vda_order = VdaOrder(order_id=f"m-{serial}", nodes=way.nodes, edges=way.edges)
            fleet.fleet.start_vda_order(RobotKey(MANUFACTURER, serial), vda_order)
        await until(lambda: fleet.story().count(VdaOrderFinished.__name__) == 2, what="both at their ends")

    peer.catch_up()
    messages = peer.received()
    told = [grants(messages, serial) for serial in SERIALS]
    assert [each[-1] for each in told] == ["GRANTED", "GRANTED"]
    assert [each.count("GRANTED") for each in told] == [1, 1]
    assert any("QUEUED" in each for each in told)
    assert most_inside(messages) == 1
    for each in messages:
        topic = each.topic.rsplit("/", 1)[1]
        assert schema_problems("3.0.0", topic, each.payload) == []
