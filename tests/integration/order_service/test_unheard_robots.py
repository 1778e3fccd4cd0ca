"""Robots of which the order service knows nothing, because it was not there when they reported.

Each robot here reports only when it connects and when it is asked; the standard allows 30 s. RabbitMQ
delivers no retained messages to wildcard subscriptions; NATS delivers a message once for each subscription.
"""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any, cast

import httpx
import pytest

from nena_conversations.kit.honest_robot import MAP, ROBOT, HonestRobot
from nena_order_service.fleet import link
from nena_order_service.fleet.robot import LinkStatus
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.plant import property_keys as keys
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from support.broker import BrokerAddress, MqttPeer
from support.fleet import make_vda_order, order_of
from support.order_service_fleet import Fleet, listening, running
from support.plants import path, point
from support.waiting import awaited, until
from support.wired_robot import WiredFleet, WiredRobot

pytestmark = pytest.mark.broker

FIRST, SECOND = RobotKey("Honest", "robot-1"), RobotKey("Honest", "robot-2")


def vehicle(robot: RobotKey, name: str) -> Vehicle:
    return Vehicle(
        name=name,
        properties={
            keys.VDA5050_MANUFACTURER: robot.manufacturer,
            keys.VDA5050_SERIAL_NUMBER: robot.serial_number,
        },
    )


ONE_WAY = PlantModel(
    name="one way",
    points=(point("A"), point("B", 1000), point("C", 2000)),
    paths=(path("A B"), path("B C")),
    vehicles=(vehicle(FIRST, "V1"), vehicle(SECOND, "V2")),
)
"""A to C leads over B."""


@pytest.fixture
def fleet(each_broker: BrokerAddress, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(each_broker, interface_name, tmp_path)
    with made.stack:
        yield made


@asynccontextmanager
async def standing(fleet: Fleet, robot: RobotKey, place: str, x: float) -> AsyncIterator[WiredRobot]:
    """Connect a robot that stands at a point; that it has said so is lost."""
    honest = HonestRobot(key=robot, last_node_id=place, position=(x, 0.0, 0.0))
    async with WiredRobot(fleet.broker, fleet.interface, honest).connected() as wired:
        yield wired


@asynccontextmanager
async def started(fleet: Fleet, **engine: Any) -> AsyncIterator[httpx.AsyncClient]:
    """Start the order service; the first time, with an empty store."""
    file = fleet.folder / "plant.json"
    file.write_text(ONE_WAY.to_json())
    engine = {"default_map_id": MAP, "restart_patience": 30.0, **engine}
    async with running(fleet.settings(plant=file, engine=engine)) as client:
        await listening(client)
        yield client


async def vehicles(client: httpx.AsyncClient) -> dict[str, dict[str, Any]]:
    found = (await client.get("/v1/vehicles")).json()["vehicles"]
    return {each["name"]: each for each in found}


async def reason_of(client: httpx.AsyncClient, part: str) -> str:
    """Wait until the reason of the order contains this."""

    async def look() -> str:
        return str((await client.get("/v1/transportOrders/T")).json()["reason"])

    return await awaited(look, lambda reason: part in reason, what=f"'{part}' in the reason")


ORDER = {"name": "T", "intendedVehicle": "V1", "destinations": [{"locationName": "C", "operation": "MOVE"}]}


async def test_no_robot_is_sent_over_the_place_of_one_that_has_only_been_there(fleet: Fleet) -> None:
    orders = fleet.peer(f"{fleet.interface}/v2/+/+/order")
    async with AsyncExitStack() as stack:
        first = await stack.enter_async_context(standing(fleet, FIRST, "A", 0.0))
        await stack.enter_async_context(standing(fleet, SECOND, "B", 1.0))
        client = await stack.enter_async_context(started(fleet))
        first.report()
        assert (await client.post("/v1/transportOrders", json=ORDER)).status_code == 201

        async def place() -> str | None:
            return cast("str | None", (await vehicles(client))["V2"]["currentPosition"])

        await awaited(place, lambda point: point == "B", what="V2 asked for its place")
        await reason_of(client, "V2")
        sent = [json.loads(each) for each in orders.payloads("+/v2/+/robot-1/order")]
        assert not [
            node for order in sent for node in order["nodes"] if node["released"] and node["nodeId"] == "B"
        ]


async def test_robot_that_is_known_to_be_offline_is_not_waited_for(fleet: Fleet) -> None:
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(standing(fleet, FIRST, "A", 0.0))
        second = WiredRobot(fleet.broker, fleet.interface, HonestRobot(key=SECOND))
        with MqttPeer(fleet.broker) as peer:
            goodbye = second._connection(ConnectionState.OFFLINE)
            peer.publish(goodbye.topic, goodbye.payload, retain=True)
        client = await stack.enter_async_context(started(fleet, restart_patience=600.0))
        assert (await client.post("/v1/transportOrders", json=ORDER)).status_code == 201

        await reason_of(client, "travels")
        assert (await vehicles(client))["V2"]["connection"] == "OFFLINE"


async def test_reason_names_the_robot_that_is_waited_for(fleet: Fleet) -> None:
    async with standing(fleet, FIRST, "A", 0.0):
        async with started(fleet, restart_patience=600.0) as client:
            assert (await client.post("/v1/transportOrders", json=ORDER)).status_code == 201
            await reason_of(client, "it waits for the first state of V2")
        async with started(fleet, restart_patience=1.0) as client:
            await reason_of(client, "travels")


@pytest.mark.parametrize(
    "topic",
    [
        "{0}x/v2/Honest/robot-2/connection",
        "{0}/2/Honest/ROBOT-2/connect",
        "{0}/v2/Honest/ROBOT-2/connection",
        "{0}/v2/HONEST/robot-2/connection",
    ],
)
async def test_a_similar_topic_is_named_as_the_reason_of_a_robot_that_was_never_heard(
    fleet: Fleet, monkeypatch: pytest.MonkeyPatch, topic: str
) -> None:
    monkeypatch.setattr(link, "SEARCHED_AFTER", 0.1)
    topic = topic.format(fleet.interface)
    greeting = WiredRobot(fleet.broker, fleet.interface, HonestRobot(key=SECOND))._connection(
        ConnectionState.ONLINE
    )
    async with started(fleet) as client:
        with MqttPeer(fleet.broker) as peer:

            async def reason() -> str:
                peer.publish(topic, greeting.payload)
                return str((await vehicles(client))["V2"]["reason"])

            expected = f"'{topic}' instead of '{fleet.interface}/v2/Honest/robot-2/connection'"
            await awaited(reason, lambda text: expected in text, what="the similar topic as the reason")


async def test_stop_reaches_robots_that_have_not_reported_and_names_them(fleet: Fleet) -> None:
    async with AsyncExitStack() as stack:
        first = await stack.enter_async_context(standing(fleet, FIRST, "A", 0.0))
        first.silent = True
        client = await stack.enter_async_context(started(fleet))
        answer = await client.post("/v1/stops", json={"by": "Anna", "reason": "fire drill"})
        assert {each["vehicle"] for each in answer.json()["notPaused"]} == {"V1", "V2"}
        await until(lambda: first.robot.paused, what="the robot is paused")

        first.silent = False
        first.report()

        async def paused() -> int:
            return int((await client.get("/v1/stops")).json()["stops"][0]["paused"])

        await awaited(paused, lambda count: count == 1, what="the pause is confirmed")


@pytest.mark.clause("4.1/offline")
async def test_robot_with_an_order_is_asked_for_its_state_after_a_cut_of_our_link(
    each_broker: BrokerAddress, interface_name: str
) -> None:
    async with (
        WiredFleet(each_broker, interface_name, vehicles={ROBOT: vehicle(ROBOT, "V1")}).connected() as fleet,
        WiredRobot(each_broker, interface_name).connected() as robot,
    ):
        robot.report()
        await until(lambda: fleet.fleet.view(ROBOT).availability.can_take_order, what="a free robot")
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
        await fleet.wait_for("VdaOrderAccepted")
        fleet.mqtt.cut(1.0)
        await until(lambda: not fleet.mqtt.state.connected, what="the cut")
        robot.robot.step()
        robot.step()  # nobody hears that it has arrived

        await fleet.wait_for("VdaOrderFinished")
        assert fleet.fleet.view(ROBOT).link is LinkStatus.ONLINE


@pytest.mark.clause("6.6/restart")
async def test_robot_with_an_order_is_asked_for_its_state_after_a_takeover(
    each_broker: BrokerAddress, interface_name: str
) -> None:
    plant = {ROBOT: vehicle(ROBOT, "V1")}
    order = make_vda_order("m", "A", "B")
    async with WiredRobot(each_broker, interface_name).connected() as robot:
        robot.robot.take_order(order_of(order, robot.robot))
        robot.step()
        robot.step()  # the order service that has sent the order is gone
        successor = WiredFleet(each_broker, interface_name, vehicles=plant, term=lambda: 1)
        successor.fleet.adopt_vda_order(ROBOT, order, accepted=True)
        async with successor.connected():
            await successor.wait_for("VdaOrderFinished")


async def test_a_large_plant_model_leaves_every_robot_reachable(
    each_broker: BrokerAddress, interface_name: str
) -> None:
    """NATS grants a connection about 60 subscriptions of QoS 1."""
    others = {RobotKey("Honest", f"absent-{number}"): Vehicle(name=f"V{number}") for number in range(200)}
    plant = {**others, ROBOT: vehicle(ROBOT, "Robot")}
    async with (
        WiredFleet(each_broker, interface_name, vehicles=plant).connected() as fleet,
        WiredRobot(each_broker, interface_name).connected() as robot,
    ):
        await until(lambda: fleet.fleet.connected_for() > 2.0, what="two seconds of a link")
        robot.report()
        await until(lambda: fleet.fleet.view(ROBOT).availability.can_take_order, what="a free robot")
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
        await fleet.wait_for("VdaOrderAccepted")
        assert not fleet.mqtt.state.refused_names


async def test_name_that_a_broker_refuses_does_not_end_our_link(
    each_broker: BrokerAddress, interface_name: str
) -> None:
    odd = {RobotKey("Honest", name): Vehicle(name=name) for name in ("robot 2", "robot.2", "$robot")}
    async with (
        WiredFleet(each_broker, interface_name, vehicles=odd).connected() as fleet,
        WiredRobot(each_broker, interface_name).connected() as robot,
    ):
        await until(lambda: fleet.fleet.connected_for() > 2.0, what="two seconds of a link")
        robot.report()
        await until(lambda: fleet.fleet.view(ROBOT).availability.can_take_order, what="a free robot")
        assert fleet.mqtt.state.connects == 1
