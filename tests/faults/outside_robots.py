"""Robots that nothing of NeNa is in: one written from VDA 5050 2.1.0 alone, one on the library vda5050-sdk.

Both drive from node to node in a fixed time, carry out actions in a fixed time and note what they do. Neither
remembers orders that have ended: an order with another orderId is a new one, as the standard has it.
"""

from __future__ import annotations

import asyncio
import json
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from faults.history import History, Kind
from nena_shared.mqtt import Inbound
from nena_shared.tasks import end
from support.broker import BrokerAddress, MqttPeer
from support.json_messages import FACTSHEET
from support.pausing import time_passes

MANUFACTURER = "NeNa"
NODE_SECONDS = 0.15
ACTION_SECONDS = 0.2
STATE_INTERVAL = 0.5
ACTIONS = [
    {"actionType": name, "actionScopes": ["NODE"], "actionParameters": [], "blockingTypes": ["HARD"]}
    for name in ("pick", "drop")
]
OWN_FACTSHEET = FACTSHEET | {"protocolFeatures": {"optionalParameters": [], "agvActions": ACTIONS}}

Json = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Standing:
    """Where a robot is, and how late it reports an order that it has taken."""

    serial: str
    map_id: str
    x: float
    y: float
    echo: float = 0.0
    """Seconds."""


class Route:
    """The present order: nodes and edges that are left, by sequenceId."""

    def __init__(self, order_id: str = "") -> None:
        self.order_id = order_id
        self.update_id = -1
        self.nodes: dict[int, Json] = {}
        self.edges: dict[int, Json] = {}

    def take(self, order: Json) -> None:
        """Append an order or update in place of the old horizon."""
        self.update_id = order["orderUpdateId"]
        first = order["nodes"][0]["sequenceId"]
        for parts, new in ((self.nodes, order["nodes"]), (self.edges, order["edges"])):
            for number in [each for each, part in parts.items() if not part["released"]]:
                del parts[number]
            known = set(parts)
            parts.update(
                {each["sequenceId"]: each for each in new if each["sequenceId"] not in known | {first}}
            )
        if self.update_id == 0:
            self.nodes[first] = order["nodes"][0]

    def next(self) -> Json | None:
        """Return the next node of the base."""
        node = self.nodes[min(self.nodes)] if self.nodes else None
        return node if node is not None and node["released"] else None


class OutsideRobot(ABC):
    """Executes its route in a separate task."""

    def __init__(self, standing: Standing, history: History) -> None:
        self.standing = standing
        self.history = history
        self.route = Route()
        self.place = {"x": standing.x, "y": standing.y, "theta": 0.0, "mapId": standing.map_id}
        self._at = ""
        """The node where it stands."""
        self._more = asyncio.Event()

    @abstractmethod
    async def arrived(self, node: Json) -> None:
        """Report that the robot is at ``node``."""

    @abstractmethod
    async def action(self, action: Json, status: str) -> None:
        """Report the status of an action."""

    def go_on(self) -> None:
        """Check again what is to be done."""
        self._more.set()

    async def work(self) -> None:
        """Drive and act until cancelled."""
        while True:
            node = self.route.next()
            if node is None:
                self._more.clear()
                await self._more.wait()
                continue
            await self._visit(self.route, node)

    async def _visit(self, route: Route, node: Json) -> None:
        name, serial = node["nodeId"], self.standing.serial
        if name != self._at:
            self.history.note(serial, Kind.ENTERED, name)
            await time_passes(NODE_SECONDS)
            if self._at:
                self.history.note(serial, Kind.LEFT, self._at)
            self._at = name
        if position := node.get("nodePosition"):
            self.place |= {"x": position["x"], "y": position["y"], "theta": position.get("theta") or 0.0}
        route.nodes.pop(node["sequenceId"], None)
        route.edges = {number: edge for number, edge in route.edges.items() if number > node["sequenceId"]}
        await self.arrived(node)
        for action in node["actions"]:
            if self.route is not route:
                return  # cancelled
            self.history.note(serial, Kind.BEGUN, action["actionId"], route.order_id)
            await self.action(action, "RUNNING")
            await time_passes(ACTION_SECONDS)
            if self.route is route:
                self.history.note(serial, Kind.ENDED, action["actionId"], route.order_id)
                await self.action(action, "FINISHED")


class StandardRobot(OutsideRobot):
    """Written from the standard alone, in plain JSON."""

    def __init__(self, standing: Standing, history: History, peer: MqttPeer, interface: str) -> None:
        super().__init__(standing, history)
        self._peer = peer
        self._topic = f"{interface}/v2/{MANUFACTURER}/{standing.serial}"
        self._numbers: Counter[str] = Counter()
        self._shown = self.route
        """What the state tells; an order that was taken is told after the echo's delay."""
        self._actions: dict[str, Json] = {}
        self._last = ("", 0)
        self._errors: list[Json] = []
        self._delayed: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Report the state from time to time."""
        while True:
            self.report()
            await time_passes(STATE_INTERVAL)

    def announce(self) -> None:
        """Publish the robot's connection and factsheet on each connection."""
        self._publish("connection", {"connectionState": "ONLINE"}, retain=True)
        self._publish("factsheet", OWN_FACTSHEET, retain=True)

    def take(self, topic: str, payload: bytes) -> None:
        """Handle an order or instant actions."""
        message = json.loads(payload)
        if topic.endswith("/order"):
            self._take_order(message)
        else:
            for action in message["actions"]:
                self._take_instant_action(action)
            self.report()

    def _take_order(self, order: Json) -> None:
        self.history.note(self.standing.serial, Kind.RECEIVED, order["orderId"])
        if order["orderId"] != self.route.order_id:
            if self._busy:
                self._errors = [
                    {
                        "errorType": "orderError",
                        "errorLevel": "WARNING",
                        "errorReferences": [{"referenceKey": "orderId", "referenceValue": order["orderId"]}],
                    }
                ]
                self.report()
                return
            self.route = Route(order["orderId"])
        elif order["orderUpdateId"] <= self.route.update_id:
            return
        self.route.take(order)
        self._errors = []
        task = asyncio.create_task(self._echo(self.route))
        self._delayed.add(task)
        task.add_done_callback(self._delayed.discard)

    async def _echo(self, route: Route) -> None:
        await time_passes(self.standing.echo)
        if self._shown is not route:
            self._actions = {}
        self._shown = route
        for node in route.nodes.values():
            for action in node["actions"]:
                self._actions.setdefault(
                    action["actionId"],
                    {
                        "actionId": action["actionId"],
                        "actionType": action["actionType"],
                        "actionStatus": "WAITING",
                    },
                )
        self.report()
        self.go_on()

    def _take_instant_action(self, action: Json) -> None:
        status = "FINISHED"
        match action["actionType"]:
            case "cancelOrder":
                gone, self.route = self.route, Route(self.route.order_id)
                self.route.update_id = gone.update_id
                self._shown = self.route
                for each in self._actions.values():
                    if each["actionStatus"] not in ("FINISHED", "FAILED"):
                        each["actionStatus"] = "FAILED"
            case "factsheetRequest":
                self._publish("factsheet", OWN_FACTSHEET, retain=True)
            case "stateRequest":
                pass
            case _:
                status = "FAILED"
        self._actions[action["actionId"]] = {
            "actionId": action["actionId"],
            "actionType": action["actionType"],
            "actionStatus": status,
        }

    @property
    def _busy(self) -> bool:
        running = any(each["actionStatus"] not in ("FINISHED", "FAILED") for each in self._actions.values())
        return bool(self.route.nodes) or running

    async def arrived(self, node: Json) -> None:
        """Report that the robot is at ``node``."""
        self._last = node["nodeId"], node["sequenceId"]
        self.report()

    async def action(self, action: Json, status: str) -> None:
        """Report the status of an action."""
        self._actions[action["actionId"]] |= {"actionStatus": status}
        self.report()

    def report(self) -> None:
        """Publish the state."""
        route = self._shown
        state = {
            "orderId": route.order_id,
            "orderUpdateId": max(route.update_id, 0),
            "lastNodeId": self._last[0],
            "lastNodeSequenceId": self._last[1],
            "nodeStates": [_part(each, "nodeId") for _, each in sorted(route.nodes.items())],
            "edgeStates": [_part(each, "edgeId") for _, each in sorted(route.edges.items())],
            "agvPosition": {**self.place, "positionInitialized": True},
            "driving": bool(route.next()),
            "actionStates": list(self._actions.values()),
            "batteryState": {"batteryCharge": 80, "charging": False},
            "operatingMode": "AUTOMATIC",
            "errors": self._errors,
            "safetyState": {"eStop": "NONE", "fieldViolation": False},
        }
        self._publish("state", state)

    def _publish(self, topic: str, content: Json, *, retain: bool = False) -> None:
        header = {
            "headerId": self._numbers[topic],
            "timestamp": _now(),
            "version": "2.1.0",
            "manufacturer": MANUFACTURER,
            "serialNumber": self.standing.serial,
        }
        self._numbers[topic] += 1
        self._peer.send(f"{self._topic}/{topic}", json.dumps(header | content), retain=retain)


def _part(part: Json, name: str) -> Json:
    return {name: part[name], "sequenceId": part["sequenceId"], "released": part["released"]}


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


@asynccontextmanager
async def standard_robot(
    broker: BrokerAddress, interface: str, standing: Standing, history: History
) -> AsyncIterator[StandardRobot]:
    """Run a robot that is written from the standard alone until the block ends."""
    loop, own = asyncio.get_running_loop(), f"{interface}/v2/{MANUFACTURER}/{standing.serial}"

    def take(message: Inbound) -> None:
        loop.call_soon_threadsafe(robot.take, message.topic, message.payload)

    def announce() -> None:
        robot.announce()

    peer = MqttPeer(
        broker,
        f"{own}/order",
        f"{own}/instantActions",
        on_message=take,
        on_connected=lambda: loop.call_soon_threadsafe(announce),
    )
    robot = StandardRobot(standing, history, peer, interface)
    with peer:
        tasks = [asyncio.create_task(robot.run()), asyncio.create_task(robot.work())]
        try:
            yield robot
        finally:
            await end(*tasks)


class LibraryRobot(OutsideRobot):
    """A robot on vda5050-sdk: the library accepts orders, keeps the state and publishes it."""

    def __init__(self, standing: Standing, history: History, client: Any) -> None:
        super().__init__(standing, history)
        self._client = client

    def take(self, order: Any) -> None:
        """Handle an order that the library has accepted."""
        wire = order.to_wire()
        self.history.note(self.standing.serial, Kind.RECEIVED, wire["orderId"])
        if wire["orderId"] != self.route.order_id:
            self.route = Route(wire["orderId"])
        self.route.take(wire)
        self.go_on()

    def take_instant_actions(self, message: Any) -> None:
        """Drop the route of an order that the library has cancelled."""
        if any(each.action_type == "cancelOrder" for each in message.actions):
            self.route = Route(self.route.order_id)

    async def arrived(self, node: Json) -> None:
        """Report that the robot is at ``node``."""
        self._client.update_position(
            **{key: self.place[key] for key in ("x", "y", "theta")}, map_id=self.place["mapId"]
        )
        self._client.mark_node_traversed(node["nodeId"], node["sequenceId"])
        await self._client.publish_state()

    async def action(self, action: Json, status: str) -> None:
        """Report the status of an action."""
        from vda5050 import ActionStatus  # noqa: PLC0415 - may be missing

        self._client.report_action(action["actionId"], ActionStatus(status), action_type=action["actionType"])
        await self._client.publish_state()


@asynccontextmanager
async def library_robot(
    broker: BrokerAddress, standing: Standing, history: History
) -> AsyncIterator[LibraryRobot]:
    """Run a robot on vda5050-sdk until the block ends; its topics begin with ``uagv``."""
    from vda5050 import VehicleClient, VehicleConfig  # noqa: PLC0415 - may be missing

    config = VehicleConfig(
        manufacturer=MANUFACTURER,
        serial_number=standing.serial,
        broker_url=f"mqtt://{broker.host}:{broker.port}",
        state_interval=STATE_INTERVAL,
    )
    client = VehicleClient(config)
    robot = LibraryRobot(standing, history, client)
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(client)
        client.on_order(robot.take)
        client.on_instant_actions(robot.take_instant_actions)
        client.update_position(x=standing.x, y=standing.y, theta=0.0, map_id=standing.map_id)
        header = {"headerId": 0, "timestamp": _now(), "version": "2.1.0"}
        identity = {"manufacturer": MANUFACTURER, "serialNumber": standing.serial}
        with MqttPeer(broker, "nothing") as peer:
            topic = f"uagv/v2/{MANUFACTURER}/{standing.serial}/factsheet"
            peer.publish(topic, json.dumps(header | identity | OWN_FACTSHEET), retain=True)
        await client.publish_state()
        working = asyncio.create_task(robot.work())
        try:
            yield robot
        finally:
            await end(working)
            with suppress(Exception):
                await client.disconnect()
