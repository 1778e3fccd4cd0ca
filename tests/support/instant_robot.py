"""A robot written from VDA 5050 2.1.0 alone, in plain JSON, that reaches its goal as soon as it has an order.

It remembers the present order only, as the standard requires: an order with another ID is a new one.
"""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import Any

from support.broker import BrokerAddress, MqttPeer
from support.json_messages import FACTSHEET

STATE_INTERVAL = 0.5
"""Seconds between two states that say nothing new."""


class InstantRobot:
    """Accepts orders without actions; ``on_order`` is called in its thread on each one."""

    def __init__(
        self, peer: MqttPeer, interface: str, *, delay: float, on_order: Callable[[str], None]
    ) -> None:
        self._peer = peer
        self._place = f"{interface}/v2/NeNa/robot-01"
        self._delay = delay
        self._on_order = on_order
        self._lock = threading.RLock()
        self._newest = ("", 0)
        """Id and update of the last order."""
        self._ended = threading.Event()
        self._header_ids: Counter[str] = Counter()
        self._order: dict[str, Any] = {"orderId": "", "orderUpdateId": 0, "nodes": [], "edges": []}
        self._node: dict[str, Any] = {"nodeId": "", "sequenceId": 0}
        self._position = {"x": 3.0, "y": 2.0, "theta": 0.0}
        self.begun: Counter[str] = Counter()
        """How often each order was begun, by its id."""

    def run(self) -> None:
        """Report connection and factsheet, then the state each :data:`STATE_INTERVAL` until :meth:`end`."""
        self._publish("connection", {"connectionState": "ONLINE"}, retain=True)
        self._publish("factsheet", FACTSHEET, retain=True)
        self.report()
        while not self._ended.wait(STATE_INTERVAL):
            self.report()

    def end(self) -> None:
        """Stop reporting."""
        self._ended.set()

    def take_order(self, payload: bytes) -> None:
        """Begin an order or continue one by its update; the state follows ``delay`` seconds later."""
        order = json.loads(payload)
        order_id, update_id = order["orderId"], order["orderUpdateId"]
        with self._lock:
            if order_id != self._newest[0]:
                self.begun[order_id] += 1
            elif update_id <= self._newest[1]:
                return
            self._newest = order_id, update_id
        self._on_order(order_id)
        threading.Timer(self._delay, self._arrive, (order,)).start()

    def _arrive(self, order: dict[str, Any]) -> None:
        with self._lock:
            self._order = order
            self._node = [each for each in order["nodes"] if each["released"]][-1]
            if place := self._node.get("nodePosition"):
                self._position = {"x": place["x"], "y": place["y"], "theta": place.get("theta", 0.0)}
            self.report()

    def report(self) -> None:
        """Publish the state."""
        with self._lock:
            self._publish("state", self._state())

    def _state(self) -> dict[str, Any]:
        nodes, edges = self._order["nodes"], self._order["edges"]
        return {
            "orderId": self._order["orderId"],
            "orderUpdateId": self._order["orderUpdateId"],
            "lastNodeId": self._node["nodeId"],
            "lastNodeSequenceId": self._node["sequenceId"],
            "nodeStates": [_ahead(each, "nodeId") for each in nodes if not each["released"]],
            "edgeStates": [_ahead(each, "edgeId") for each in edges if not each["released"]],
            "agvPosition": {**self._position, "mapId": "sample-hall", "positionInitialized": True},
            "driving": False,
            "actionStates": [],
            "batteryState": {"batteryCharge": 80, "charging": False},
            "operatingMode": "AUTOMATIC",
            "errors": [],
            "safetyState": {"eStop": "NONE", "fieldViolation": False},
        }

    def _publish(self, topic: str, content: dict[str, Any], *, retain: bool = False) -> None:
        header = {
            "headerId": self._header_ids[topic],
            "timestamp": datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z"),
            "version": "2.1.0",
            "manufacturer": "NeNa",
            "serialNumber": "robot-01",
        }
        self._header_ids[topic] += 1
        self._peer.send(f"{self._place}/{topic}", json.dumps(header | content), retain=retain)


def _ahead(part: dict[str, Any], name: str) -> dict[str, Any]:
    return {name: part[name], "sequenceId": part["sequenceId"], "released": False}


@contextmanager
def instant_robot(
    broker: BrokerAddress, interface: str, *, delay: float, on_order: Callable[[str, InstantRobot], None]
) -> Iterator[InstantRobot]:
    """Run such a robot until the block ends."""
    orders = f"{interface}/v2/NeNa/robot-01/order"
    peer = MqttPeer(broker, orders, on_message=lambda message: robot.take_order(message.payload))
    robot = InstantRobot(peer, interface, delay=delay, on_order=lambda name: on_order(name, robot))
    with peer:
        reporting = threading.Thread(target=robot.run, name="instant robot")
        reporting.start()
        try:
            yield robot
        finally:
            robot.end()
            reporting.join()
