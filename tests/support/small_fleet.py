"""A fleet control that keeps to VDA 5050 and can do little: orders of three nodes, and cancels.

It shares no line with the order service. Faulty ones change what it decides, or what it writes.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from itertools import count, pairwise
from time import monotonic
from typing import Any

from nena_conversations.broker import BrokerAddress, connect_broker
from nena_conversations.kit.fleet_session import Wanted
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import EmergencyStop, State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from support.pausing import time_passes

Message = dict[str, Any]
TICK = 0.02
RESEND_AFTER = 0.5
SENDINGS = 20
"""How often it sends an order that no state shows: for longer than a busy broker is silent."""
ORDER_INTERVAL = 0.1


class SmallFleet:
    """Controls one robot; its methods that decide something may be overridden."""

    qos = 0
    retain = False

    def __init__(self, link: MqttLink, topics: TopicScheme, codec: Codec, robot: RobotKey) -> None:
        self.codec, self.robot = codec, robot
        self.state: State | None = None
        self.connection = ConnectionState.OFFLINE
        self.wanted = False
        self.order: Message | None = None
        """The order that is not done yet, as last sent."""
        self.confirmed = False
        self.sendings = 0
        self.sent_at = 0.0
        self.cancel_id = ""
        self._link, self._topics = link, topics
        self._headers: dict[Topic, int] = {}
        self.numbers = count(1)
        link.subscribe(topics.of(robot, Topic.STATE), self._on_state)
        link.subscribe(topics.of(robot, Topic.CONNECTION), self._on_connection)

    async def ask(self, wanted: Wanted, _robot: RobotKey) -> None:
        if wanted is Wanted.ORDER:
            self.wanted = True
        elif wanted is Wanted.CANCEL and self.order and not self.cancel_id:
            self.cancel()
        self.think()

    async def run(self) -> None:
        while True:
            await time_passes(TICK)
            self.think()

    def think(self) -> None:
        state = self.state
        if state is None:
            return
        if self.cancel_id:
            self.watch_cancel(state)
        elif self.order is None:
            if self.wanted and self.may_order(state) and monotonic() - self.sent_at > ORDER_INTERVAL:
                self.begin(state)
        elif not self.reachable():
            return
        elif state.order_id == self.order["orderId"]:
            self.go_on(state)
        elif self.confirmed or not state.operating_mode.takes_orders or self.is_refused(state):
            self.end()
        elif monotonic() - self.sent_at > RESEND_AFTER:
            self.repeat()

    # what it decides

    def reachable(self) -> bool:
        return self.connection is ConnectionState.ONLINE

    def may_order(self, state: State) -> bool:
        return (
            self.reachable()
            and state.operating_mode.takes_orders
            and not state.node_states
            and not state.edge_states
            and not any(each.error_level is ErrorLevel.FATAL for each in state.errors)
            and state.safety_state.active_emergency_stop is EmergencyStop.NONE
        )

    def begin(self, state: State) -> None:
        place = state.mobile_robot_position
        assert place
        number = next(self.numbers)
        here = state.last_node_id or f"n{number}-0"
        nodes = [
            self.node(here, 0, place.x, place.y, place.map_id),
            self.node(f"n{number}-1", 2, place.x + 1, place.y, place.map_id),
            {**self.node(f"n{number}-2", 4, place.x, place.y + 1, place.map_id), "released": False},
        ]
        nodes[1]["actions"] = [self.action(f"a-{number}", "beep", "HARD")]
        self.wanted, self.confirmed, self.sendings = False, False, 0
        self.order = self.linked({"orderId": f"o-{number}", "orderUpdateId": 0, "nodes": nodes})
        self.send_order(self.order)

    def go_on(self, state: State) -> None:
        assert self.order
        self.confirmed = self.confirmed or state.order_update_id == self.order["orderUpdateId"]
        nodes = self.order["nodes"]
        if state.order_update_id < self.order["orderUpdateId"]:
            if not state.node_states:
                self.end()
            elif any(each.error_references for each in state.errors):
                self.on_refused_update()
            elif monotonic() - self.sent_at > RESEND_AFTER:
                self.repeat()
        elif not state.node_states:
            if all(each.action_status.ended for each in state.action_states):
                self.end()  # done, or cleared by the mode
        elif (
            not nodes[-1]["released"]
            and state.last_node_sequence_id >= nodes[-2]["sequenceId"]
            and monotonic() - self.sent_at > ORDER_INTERVAL
        ):
            self.extend()

    def extend(self) -> None:
        assert self.order
        stitch, last = self.order["nodes"][-2:]
        update = self.order["orderUpdateId"] + 1
        nodes = [stitch, {**last, "released": True}]
        self.order = self.linked({**self.order, "orderUpdateId": update, "nodes": nodes})
        self.sendings = 0
        self.send_order(self.order)

    def repeat(self) -> None:
        assert self.order
        if self.sendings >= SENDINGS:
            self.end()
        else:
            self.send_order(self.order)

    def is_refused(self, state: State) -> bool:
        assert self.order
        named = {each.reference_value for error in state.errors for each in error.error_references}
        return self.order["orderId"] in named

    def on_refused_update(self) -> None:
        """Give up: a person cancels the order."""

    def cancel(self) -> None:
        assert self.order
        self.cancel_id = f"c-{next(self.numbers)}"
        action = self.action(self.cancel_id, "cancelOrder", "NONE")
        if self.codec.major_version != "v2":
            action["actionParameters"] = [{"key": "orderId", "value": self.order["orderId"]}]
        self.send(Topic.INSTANT_ACTIONS, {"actions": [action]})

    def watch_cancel(self, state: State) -> None:
        states = (*state.instant_action_states, *state.action_states)
        if any(each.action_id == self.cancel_id and each.action_status.ended for each in states):
            self.end()

    def end(self) -> None:
        self.order, self.cancel_id = None, ""

    # what it writes

    def node(self, name: str, sequence: int, x: float, y: float, map_id: str) -> Message:
        position = {"x": x, "y": y, "mapId": map_id}
        made = {"nodeId": name, "sequenceId": sequence, "released": True, "nodePosition": position}
        return {**made, "actions": []}

    def action(self, action_id: str, action_type: str, blocking: str) -> Message:
        return {"actionId": action_id, "actionType": action_type, "blockingType": blocking}

    def linked(self, order: Message) -> Message:
        edges = []
        for start, end in pairwise(order["nodes"]):
            edge = {"edgeId": f"{start['nodeId']}-{end['nodeId']}", "sequenceId": start["sequenceId"] + 1}
            edge |= {"released": end["released"], "actions": []}
            if self.codec.major_version == "v2":
                edge |= {"startNodeId": start["nodeId"], "endNodeId": end["nodeId"]}
            edges.append(edge)
        return {**order, "edges": edges}

    def send_order(self, order: Message) -> None:
        self.sendings += 1
        self.sent_at = monotonic()
        self.send(Topic.ORDER, order)

    def send(self, topic: Topic, content: Message) -> None:
        self._headers[topic] = self._headers.get(topic, -1) + 1
        header = {
            "headerId": self._headers[topic],
            "timestamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "version": self.codec.version,
            "manufacturer": self.robot.manufacturer,
            "serialNumber": self.robot.serial_number,
        }
        self.write(topic, json.loads(json.dumps({**header, **content})))

    def write(self, topic: Topic, message: Message) -> None:
        name, payload = self._topics.of(self.robot, topic), json.dumps(message).encode()
        self._link.publish(Outbound(name, payload, qos=self.qos, retain=self.retain))

    def _on_state(self, inbound: Inbound) -> None:
        self.state = self.codec.decode(State, inbound.payload)
        self.think()

    def _on_connection(self, inbound: Inbound) -> None:
        if inbound.payload:
            self.connection = self.codec.decode(Connection, inbound.payload).connection_state


Kind = Callable[[MqttLink, TopicScheme, Codec, RobotKey], SmallFleet]


@asynccontextmanager
async def running_fleet(
    address: BrokerAddress, topics: TopicScheme, codec: Codec, robot: RobotKey, kind: Kind = SmallFleet
) -> AsyncIterator[SmallFleet]:
    """Run a fleet control for one robot until the block ends."""
    async with connect_broker(address, f"small-fleet-{topics.interface_name}") as link:
        fleet = kind(link, topics, codec, robot)
        task = asyncio.create_task(fleet.run())
        try:
            yield fleet
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            if fleet.retain:
                for topic in (Topic.ORDER, Topic.INSTANT_ACTIONS):
                    link.publish(Outbound(topics.of(robot, topic), b"", retain=True))
                await link.drain(5.0)
