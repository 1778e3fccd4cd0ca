"""Robots that deviate from VDA 5050, all under one order service: each works, or REST says why not."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import httpx
import pytest

from nena_conversations.kit.honest_robot import MAP, HonestRobot
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.deviating_robots import DEVIATIONS, Deviation
from support.order_service_fleet import Fleet
from support.pausing import time_passes
from support.plants import path, point
from support.waiting import awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
MANUFACTURER = "Deviating"
SILENT_AFTER = 4.0
"""Seconds."""
REPORTED_EACH = 0.5
LANE_MM = 5000


class DeviatingRobot:
    """A robot that does what it is told, whose messages deviate."""

    def __init__(self, number: int, deviation: Deviation, fleet: Fleet, link: MqttLink) -> None:
        self.deviation = deviation
        self.codec = codec_for(deviation.version)
        place = (0.0, number * LANE_MM / 1000, 0.0)
        key = RobotKey(MANUFACTURER, str(number))
        self.robot = HonestRobot(key=key, position=place, version=deviation.version)
        self.robot.reports_instants_apart = deviation.version.startswith("3.")
        self._scheme = TopicScheme(fleet.interface, self.codec.major_version)
        self._link = link
        link.subscribe(self._scheme.of(key, Topic.ORDER), self._take_order)
        link.subscribe(self._scheme.of(key, Topic.INSTANT_ACTIONS), self._take_actions)

    def introduction(self) -> tuple[Outbound, ...]:
        """Return what says that it is there, and what it can do."""
        online = self.robot.connection(ConnectionState.ONLINE)
        return self._message(Topic.CONNECTION, online), self._message(Topic.FACTSHEET, self.robot.factsheet())

    def report(self) -> None:
        """Send the state, and do the next step."""
        state = self.robot.state(asyncio.get_running_loop().time())
        self._link.publish(self._message(Topic.STATE, state))
        self.robot.step()

    def _message(self, topic: Topic, message: Header) -> Outbound:
        payload = self.codec.encode(message)
        if topic is self.deviation.topic:
            payload = self.deviation.applied(payload)
        return Outbound(self._scheme.of(self.robot.key, topic), payload, qos=1, keep=False)

    def _take_order(self, inbound: Inbound) -> None:
        self.robot.take_order(self.codec.decode(Order, inbound.payload))
        self.report()

    def _take_actions(self, inbound: Inbound) -> None:
        self.robot.take_instant_actions(self.codec.decode(InstantActions, inbound.payload))
        self.report()


@asynccontextmanager
async def reporting(fleet: Fleet) -> AsyncIterator[None]:
    """Let all robots report as long as the block lasts."""
    robots: list[DeviatingRobot] = []

    def introduce() -> list[Outbound]:
        return [message for each in robots for message in each.introduction()]

    link = MqttLink(
        fleet.broker.settings, client_id=f"robots-{fleet.interface}", hooks=LinkHooks(on_connected=introduce)
    )
    robots += [DeviatingRobot(number, each, fleet, link) for number, each in enumerate(DEVIATIONS)]

    async def report() -> None:
        while True:
            for each in robots:
                each.report()
            await time_passes(REPORTED_EACH)

    tasks = [asyncio.create_task(link.run()), asyncio.create_task(report())]
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def lanes() -> PlantModel:
    """Make a plant with a lane and a vehicle for each deviation."""
    numbers = range(len(DEVIATIONS))
    points = [point(f"{end}{at}", x, at * LANE_MM) for at in numbers for end, x in (("A", 0), ("B", LANE_MM))]
    return PlantModel(
        name="lanes",
        points=tuple(each.model_copy(update={"properties": {"vda5050:mapId": MAP}}) for each in points),
        paths=tuple(path(f"A{at} B{at}", LANE_MM) for at in numbers),
        vehicles=tuple(
            Vehicle(
                name=f"V{at}",
                properties={"vda5050:manufacturer": MANUFACTURER, "vda5050:serialNumber": str(at)},
            )
            for at in numbers
        ),
    )


def amiss(deviation: Deviation, vehicle: Mapping[str, Any], order: Mapping[str, Any]) -> str:
    """Return what is not as the table says; empty: nothing."""
    reports = vehicle["deviations"]
    if deviation.report and not any(each.startswith(deviation.report) for each in reports):
        return f"{deviation.words}: not reported, but {reports}; {vehicle['reason']}"
    if not deviation.report and reports:
        return f"{deviation.words}: reported as {reports}"
    if deviation.refusal and (
        order["state"] == "FINISHED" or not vehicle["reason"].startswith(deviation.refusal)
    ):
        return f"{deviation.words}: {order['state']}, {vehicle['reason']}"
    parts = [deviation.refusal]
    used_as_it_is = deviation.report.endswith("in doubt")
    if not used_as_it_is and not deviation.refusal.startswith("sends states that are unreadable"):
        parts.append(deviation.report.removeprefix("state.").rpartition(":")[0])
    if deviation.refusal and any(part not in order["reason"] for part in parts):
        return f"{deviation.words}: the order's reason does not say why: {order['reason']}"
    if not deviation.refusal and order["state"] != "FINISHED":
        return f"{deviation.words}: {order['state']}, {order['reason']}; {vehicle['reason']}"
    return ""


async def test_each_request_works_or_is_refused_with_a_reason(fleet: Fleet, service: Start) -> None:
    file = fleet.folder / "lanes.json"
    file.write_text(lanes().to_json())
    client = await service(plant=file, fleet={"silent_after": SILENT_AFTER, "silent_intervals": 0})
    for number in range(len(DEVIATIONS)):
        order = {
            "name": f"T{number}",
            "intendedVehicle": f"V{number}",
            "destinations": [{"locationName": f"B{number}"}],
        }
        assert (await client.post("/v1/transportOrders", json=order)).status_code == 201
    began = asyncio.get_running_loop().time()

    async def look() -> list[str]:
        vehicles = (await client.get("/v1/vehicles", params={"limit": 1000})).json()["vehicles"]
        orders = (await client.get("/v1/transportOrders", params={"limit": 1000})).json()["transportOrders"]
        by_vehicle, by_order = ({each["name"]: each for each in them} for them in (vehicles, orders))
        found = [
            amiss(each, by_vehicle[f"V{number}"], by_order[f"T{number}"])
            for number, each in enumerate(DEVIATIONS)
        ]
        return [each for each in found if each]

    def over(found: list[str]) -> bool:
        """Return whether all is as it has to be, even after the time after which a silent robot is one."""
        return not found and asyncio.get_running_loop().time() - began > 2 * SILENT_AFTER

    async with reporting(fleet):
        await awaited(look, over, what="what the table says", every=0.2)
