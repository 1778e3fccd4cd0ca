"""Robots whose states are unreadable, have no order, or say an impossible position, under an order service.

The states are those of public robots, changed as little as possible from a conforming robot's.
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any

import httpx
import pytest

from nena_conversations.kit.honest_robot import MAP, HonestRobot
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.tasks import end
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.order_service_fleet import Fleet
from support.pausing import time_passes
from support.plants import path, point
from support.waiting import awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]
Content = dict[str, Any]
Change = Callable[[Content], object]
CODEC = codec_for("2.1.0")
QUICK: dict[str, Any] = {"resend_after": 0.1, "resend_at_most_after": 0.1, "sendings": 600}
REPORTED_EACH = 0.1
SPACING_M = 4.0


def unchanged(_: Content) -> None:
    pass


def line(*names: str) -> PlantModel:
    """Return a plant of points in a line, 4 m apart, with paths in both directions."""
    spacing = round(SPACING_M * 1000)
    pairs = list(pairwise(names))
    return PlantModel(
        name="line",
        points=tuple(
            point(name, at * spacing, properties={"vda5050:mapId": MAP}) for at, name in enumerate(names)
        ),
        paths=tuple(
            path(ends, spacing) for pair in pairs for ends in (f"{pair[0]} {pair[1]}", f"{pair[1]} {pair[0]}")
        ),
        vehicles=tuple(
            Vehicle(name=name, properties={"vda5050:manufacturer": "FIELD", "vda5050:serialNumber": name})
            for name in ("r1", "r2")
        ),
    )


class OddRobot:
    """A robot that does what it is told, and changes its states before it sends them."""

    def __init__(self, fleet: Fleet, name: str, x: float, node: str, change: Change = unchanged) -> None:
        self.change = change
        self.robot = HonestRobot(key=RobotKey("FIELD", name), position=(x, 0.0, 0.0), last_node_id=node)
        self.orders: list[Order] = []
        self._scheme = TopicScheme(fleet.interface, "v2")
        self._link = MqttLink(
            fleet.broker.settings,
            client_id=f"{fleet.interface}-{name}",
            hooks=LinkHooks(on_connected=self._introduction),
        )
        self._link.subscribe(self._scheme.of(self.robot.key, Topic.ORDER), self._take_order)
        self._link.subscribe(self._scheme.of(self.robot.key, Topic.INSTANT_ACTIONS), self._take_actions)

    @property
    def released(self) -> set[str]:
        """The nodes that it may drive to."""
        return {node.node_id for order in self.orders for node in order.nodes if node.released}

    @asynccontextmanager
    async def reporting(self) -> AsyncIterator[None]:
        """Report until the block ends."""
        tasks = [asyncio.create_task(self._link.run()), asyncio.create_task(self._report())]
        try:
            yield
        finally:
            await end(*tasks)

    async def _report(self) -> None:
        while True:
            content = json.loads(CODEC.encode(self.robot.state(time.time())))
            self.change(content)
            self._publish(Topic.STATE, json.dumps(content).encode())
            self.robot.step()
            await time_passes(REPORTED_EACH)

    def _introduction(self) -> list[Outbound]:
        messages = {
            Topic.CONNECTION: self.robot.connection(ConnectionState.ONLINE),
            Topic.FACTSHEET: self.robot.factsheet(),
        }
        return [
            Outbound(self._scheme.of(self.robot.key, topic), CODEC.encode(message), keep=False)
            for topic, message in messages.items()
        ]

    def _publish(self, topic: Topic, payload: bytes) -> None:
        self._link.publish(Outbound(self._scheme.of(self.robot.key, topic), payload, keep=False))

    def _take_order(self, inbound: Inbound) -> None:
        self.orders.append(CODEC.decode(Order, inbound.payload))
        self.robot.take_order(self.orders[-1])

    def _take_actions(self, inbound: Inbound) -> None:
        self.robot.take_instant_actions(CODEC.decode(InstantActions, inbound.payload))


async def start_on(
    service: Start, fleet: Fleet, *names: str, sendings: int = QUICK["sendings"], **engine: Any
) -> httpx.AsyncClient:
    """Start the order service on a line of points."""
    file = fleet.folder / "line.json"
    file.write_text(line(*names).to_json())
    settings = {**QUICK, "sendings": sendings}
    return await service(plant=file, fleet=settings, engine={"speed_limits": False, **engine})


async def vehicle(client: httpx.AsyncClient, name: str) -> Content:
    found: Content = (await client.get(f"/v1/vehicles/{name}")).json()
    return found


async def order_of(client: httpx.AsyncClient, name: str = "T") -> Content:
    found: Content = (await client.get(f"/v1/transportOrders/{name}")).json()
    return found


async def create(
    client: httpx.AsyncClient, goal: str | Content, vehicle: str = "r1", **requests: object
) -> None:
    destination = {"locationName": goal} if isinstance(goal, str) else {"coordinate": goal}
    body = {"name": "T", "intendedVehicle": vehicle, "destinations": [destination], **requests}
    assert (await client.post("/v1/transportOrders", json=body)).status_code == 201


async def said(look: Callable[[], Awaitable[Content]], *words: str, state: str = "") -> Content:
    """Wait until a reason contains these words, in this state."""

    def found(status: Content) -> bool:
        return all(word in status["reason"] for word in words) and state in ("", status["state"])

    return await awaited(look, found, what=f"{words} {state}")


def leave_out(*names: str) -> Change:
    def change(content: Content) -> None:
        for name in names:
            del content[name]

    return change


UNREADABLE: dict[str, Change] = {
    "actionStates": lambda content: content.update(actionStates=[{"id": "7", "state": "RUNNING"}]),
    "nodeStates": leave_out("nodeStates"),
    "message": lambda content: content.update(
        powerSupply=content.pop("batteryState"),
        mobileRobotPosition=content.pop("agvPosition") | {"localized": True},
    ),
    "driving": lambda content: content.update(driving="perhaps"),
    "orderId": lambda content: content.update(orderId={}),
}


@pytest.mark.parametrize("field", UNREADABLE)
async def test_a_robot_with_unreadable_states_keeps_others_away(
    fleet: Fleet, service: Start, field: str
) -> None:
    client = await start_on(service, fleet, "A", "B", "C", "D")
    first, second = OddRobot(fleet, "r1", 0.0, "A"), OddRobot(fleet, "r2", 4.0, "B", UNREADABLE[field])
    async with first.reporting(), second.reporting():
        await said(lambda: vehicle(client, "r2"), f"sends states that are unreadable: {field}")
        await said(lambda: vehicle(client, "r1"), "idle")
        await create(client, "C")
        await said(lambda: order_of(client), "r2, which stands on 'B'", f"unreadable: {field}")
        shown = await vehicle(client, "r2")
        assert (shown["currentPosition"], shown["precisePosition"]["x"]) == ("B", 4.0)
        assert first.released <= {"A"}

        second.robot.position, second.robot.last_node_id = (12.0, 0.0, 0.0), "D"
        await said(lambda: order_of(client), state="FINISHED")
        assert second.orders == []


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (leave_out("safetyState"), "emergency stop"),
        (leave_out("batteryState"), "critical energy"),
        (lambda content: content.update(safetyState=[], batteryState=7), "emergency stop"),
    ],
)
async def test_safest_values_replace_missing_ones(
    fleet: Fleet, service: Start, change: Change, reason: str
) -> None:
    client = await start_on(service, fleet, "A", "B", "C")
    async with OddRobot(fleet, "r2", 4.0, "B", change).reporting():
        await create(client, "C", "r2")
        shown = await said(lambda: vehicle(client, "r2"), reason)
        assert any(each.endswith("replaced") for each in shown["deviations"])
        assert shown["currentPosition"] == "B"


@pytest.mark.parametrize("version", ["1.3.2", "0.8.4", "5.0.0", "3.0.0"])
async def test_the_topic_decides_how_a_version_that_does_not_exist_is_read(
    fleet: Fleet, service: Start, version: str
) -> None:
    client = await start_on(service, fleet, "A", "B")
    change: Change = lambda content: content.update(version=version)  # noqa: E731
    async with OddRobot(fleet, "r1", 0.0, "A", change).reporting():
        await create(client, "B")
        await said(lambda: order_of(client), state="FINISHED")
        shown = await vehicle(client, "r1")
        assert shown["deviations"] == [f"state.version {version}, read as 2.1.0: unknown version"]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (UNREADABLE["actionStates"], "actionStates.0.actionId: is missing"),
        (lambda content: content.update(actionStates=[{"actionId": None}]), "actionStates.0.actionId"),
        (leave_out("orderUpdateId"), "orderUpdateId: is missing"),
    ],
)
async def test_states_that_become_unreadable_are_the_reason_of_the_failure(
    fleet: Fleet, service: Start, change: Change, problem: str
) -> None:
    client = await start_on(service, fleet, "A", "B", "C", sendings=30)

    def with_an_order(content: Content) -> None:
        if content["orderId"]:
            change(content)

    robot = OddRobot(fleet, "r1", 0.0, "A", with_an_order)
    async with robot.reporting():
        await create(client, "C")
        failed = await said(lambda: order_of(client), problem, "unknown whether the robot", state="FAILED")
        assert "never accepted" not in failed["reason"]
        await said(lambda: vehicle(client, "r1"), "sends states that are unreadable", problem)
        assert (await vehicle(client, "r1"))["precisePosition"]["x"] == robot.robot.position[0]


def at_unix_time(unit: float, kind: Callable[[float], Any], header_id: int | None = 0) -> Change:
    def change(content: Content) -> None:
        content["timestamp"] = kind(time.time() * unit)
        content["headerId"] = header_id
        if header_id is None:
            del content["headerId"]

    return change


def without_order(content: Content) -> None:
    del content["headerId"], content["timestamp"]


WITHOUT_ORDER: dict[str, Change] = {
    "seconds": at_unix_time(1, int),
    "milliseconds, no headerId": at_unix_time(1000, int, None),
    "milliseconds as text": at_unix_time(1000, lambda now: str(int(now))),
    "decimals": at_unix_time(1, float, 7),
    "microseconds": at_unix_time(1e6, int),
    "nothing": without_order,
    "the same header": lambda content: content.update(headerId=0, timestamp="1970-01-01T00:00:00.000Z"),
}


@pytest.mark.parametrize("kind", WITHOUT_ORDER)
async def test_states_without_an_order_count(fleet: Fleet, service: Start, kind: str) -> None:
    client = await start_on(service, fleet, "A", "B", "C")
    async with OddRobot(fleet, "r1", 0.0, "A", WITHOUT_ORDER[kind]).reporting():
        await create(client, "C")
        await said(lambda: order_of(client), state="FINISHED")
        assert (await vehicle(client, "r1"))["precisePosition"]["x"] == 2 * SPACING_M


async def test_an_idle_robot_without_headers_is_not_silent(fleet: Fleet, service: Start) -> None:
    file = fleet.folder / "line.json"
    file.write_text(line("A", "B").to_json())
    client = await service(plant=file, fleet={**QUICK, "silent_after": 0.5, "silent_intervals": 0})
    async with OddRobot(fleet, "r1", 0.0, "A", without_order).reporting():
        await said(lambda: vehicle(client, "r1"), "idle")
        await time_passes(1.5)
        # on a busy machine, even a state may be half a second late
        await awaited(
            lambda: vehicle(client, "r1"), lambda told: told["connection"] == "ONLINE", what="it is heard"
        )


async def test_ignored_states_are_counted_and_named(fleet: Fleet, service: Start) -> None:
    file = fleet.folder / "line.json"
    file.write_text(line("A", "B").to_json())
    client = await service(plant=file, fleet={**QUICK, "silent_after": 0.5, "silent_intervals": 0})
    robot = OddRobot(fleet, "r1", 0.0, "A")
    async with robot.reporting():
        await said(lambda: vehicle(client, "r1"), "idle")
        robot.change = lambda content: content.update(headerId=0, timestamp="1970-01-01T00:00:00.000Z")
        await said(
            lambda: vehicle(client, "r1"), "states that are ignored", "headerId 0 of 1970-01-01T00:00:00"
        )
        metrics = (await client.get("/metrics")).text
    (line_,) = [each for each in metrics.splitlines() if 'ignored_total{reason="old_state"}' in each]
    assert float(line_.split()[-1]) > 0


GOALS: list[str | Content] = ["A", {"x": 1.0, "y": 0.0}]


@pytest.mark.parametrize("goal", GOALS)
@pytest.mark.parametrize("place", [(3228.0, 3143.0), (500.0, 400.0), (4.0, 9.0)])
async def test_a_robot_far_from_every_point_gets_no_order(
    fleet: Fleet, service: Start, place: tuple[float, float], goal: str | Content
) -> None:
    client = await start_on(service, fleet, "A", "B", "C")
    robot = OddRobot(fleet, "r1", place[0], "")
    robot.robot.position = (*place, 0.0)
    async with robot.reporting():
        await create(client, goal)
        words = "m from the nearest point", "check the units and the map transform"
        await said(lambda: vehicle(client, "r1"), *words, "traffic control does not know where it stands")
        await said(lambda: order_of(client), *words)
        assert robot.orders == []

        robot.robot.position = (4.0, 3.0, 0.0)
        done = await said(lambda: order_of(client), state="FINISHED")
        first_legs = [
            each for entry in done["history"] for each in entry["supplements"] if "straight" in each
        ]
        assert first_legs == ["it is the intended robot; it first drives 3.0 m straight to 'B'"]


async def test_the_distance_is_a_setting(fleet: Fleet, service: Start) -> None:
    client = await start_on(service, fleet, "A", "B", max_distance_to_point=2.0)
    robot = OddRobot(fleet, "r1", -3.0, "")
    async with robot.reporting():
        await said(lambda: vehicle(client, "r1"), "its position is 3 m from the nearest point 'A'")


async def test_a_robot_whose_position_jumps_gets_no_more_base(fleet: Fleet, service: Start) -> None:
    client = await start_on(service, fleet, "A", "B", "C", "D", release_ahead=1)
    robot = OddRobot(fleet, "r1", 0.0, "A")

    def jump(content: Content) -> None:
        if content["lastNodeId"] == "B":
            content["agvPosition"] |= {"x": 3228.0, "y": 3143.0}

    robot.change = jump
    async with robot.reporting():
        await create(client, "D")
        await said(lambda: order_of(client), "m from the nearest point", "check the units")
        assert "D" not in robot.released
        robot.change = unchanged
        await said(lambda: order_of(client), state="FINISHED")


@pytest.mark.clause("6.1.4/fleet")
@pytest.mark.parametrize("named", [True, False])
async def test_a_refused_update_does_not_end_the_transport_order(
    fleet: Fleet, service: Start, *, named: bool
) -> None:
    file = fleet.folder / "line.json"
    file.write_text(line("A", "B", "C", "D", "E").to_json())
    client = await service(plant=file, fleet=QUICK, engine={"speed_limits": False})
    first, second = OddRobot(fleet, "r1", 0.0, "A"), OddRobot(fleet, "r2", 8.0, "C")
    first.robot.refuses_updates, first.robot.names_refusals = True, named
    async with first.reporting(), second.reporting():
        await said(lambda: vehicle(client, "r2"), "idle")
        await create(client, "D")
        await said(lambda: order_of(client), "r2", state="BEING_PROCESSED")
        second.robot.position, second.robot.last_node_id = (16.0, 0.0, 0.0), "E"
        await said(lambda: order_of(client), "the robot refuses to continue the order", "orderUpdateError")
        await said(lambda: vehicle(client, "r1"), "the robot refuses to continue the order")

        first.robot.refuses_updates = False
        first.robot.errors.clear()
        await said(lambda: order_of(client), state="FINISHED")

    assert first.robot.accepted == ["T-0"]


@pytest.mark.clause("6.6.6/fleet")
async def test_a_robot_switched_to_manual_names_the_mode_everywhere(fleet: Fleet, service: Start) -> None:
    client = await start_on(service, fleet, "A", "B", "C", "D")
    first = OddRobot(fleet, "r1", 0.0, "A")

    def switch(_: Content) -> None:
        if first.robot.accepted:  # it keeps its order for now, and stands
            first.robot.mode, first.robot.paused = OperatingMode.MANUAL, True

    first.change = switch
    async with first.reporting():
        await said(lambda: vehicle(client, "r1"), "idle")
        await create(client, "D", onFailure=[])
        await said(lambda: order_of(client), "operating mode manual", state="BEING_PROCESSED")
        await said(lambda: vehicle(client, "r1"), "operating mode manual")
        first.robot.set_mode(OperatingMode.MANUAL)  # now it drops its order

        await said(lambda: order_of(client), "when it changed to operating mode manual", state="FAILED")
        await said(lambda: vehicle(client, "r1"), "operating mode manual")
