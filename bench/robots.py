"""Robots outside of the measured processes: VDA 5050 2.1 over one connection, each on its lane."""

from __future__ import annotations

import json
import queue
import threading
from datetime import UTC, datetime
from typing import Any

from bench import lanes
from bench.wire import Wire
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC
from support.fleet_examples import factsheet

ROUTE_NODES = 20
"""Nodes ahead of a robot under way: its state takes 4 kB."""
STATE_INTERVAL = 25.0
"""Seconds between the states of a robot at rest; VDA 5050 requires one each 30 s."""

Message = dict[str, Any]


class Robots:
    """``number`` robots that accept orders; they finish them at once, or drive for ever (``driving``)."""

    def __init__(self, port: int, number: int, *, driving: bool = False) -> None:
        self.orders: queue.SimpleQueue[tuple[str, float]] = queue.SimpleQueue()
        """orderId, and the moment of arrival."""
        self._driving = driving
        self._states = {lanes.robot(each): _first_state(each) for each in range(number)}
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._wire = Wire(port, "bench-robots", ("uagv/v2/+/+/order",), self._accept)
        for serial in self._states:
            self._introduce(serial)
        self._repeating = threading.Thread(target=self._repeat_states, name="bench states")
        self._repeating.start()

    def close(self) -> None:
        """Disconnect."""
        self._closed.set()
        self._repeating.join()
        self._wire.close()

    def send_state(self, number: int, **changed: Any) -> None:
        """Publish the next state of a robot."""
        serial = lanes.robot(number % len(self._states))
        with self._lock:
            self._publish_state(serial, **changed)

    def _publish_state(self, serial: str, **changed: Any) -> None:
        state = self._states[serial]
        state.update(changed, headerId=state["headerId"] + 1, timestamp=_timestamp())
        self._publish(serial, "state", state)

    def _repeat_states(self) -> None:
        while True:
            for serial in self._states:
                if self._closed.wait(STATE_INTERVAL / len(self._states)):
                    return
                with self._lock:
                    self._publish_state(serial)

    def _accept(self, topic: str, payload: bytes, moment: float) -> None:
        order, serial = json.loads(payload), topic.split("/")[-2]
        self.orders.put((order["orderId"], moment))
        last = order["nodes"][-1]
        taken = {"orderId": order["orderId"], "orderUpdateId": order["orderUpdateId"]}
        with self._lock:
            if self._driving:
                self._publish_state(serial, **taken, **_under_way())
                return
            position = last["nodePosition"]
            self._publish_state(
                serial,
                **taken,
                lastNodeId=last["nodeId"],
                lastNodeSequenceId=last["sequenceId"],
                agvPosition={**_position(position["x"], position["y"]), "mapId": position["mapId"]},
            )

    def _introduce(self, serial: str) -> None:
        """Publish what the order service would ask for otherwise."""
        sheet = factsheet(robot=RobotKey("NeNa", serial))
        limits = sheet.protocol_limits
        timing = limits.timing.model_copy(update={"minimum_order_interval": 0.0})
        sheet = sheet.model_copy(update={"protocol_limits": limits.model_copy(update={"timing": timing})})
        self._publish(serial, "factsheet", json.loads(CODEC.encode(sheet)), retain=True)
        self._publish_state(serial)
        self._publish(serial, "connection", {**_header(serial), "connectionState": "ONLINE"}, retain=True)

    def _publish(self, serial: str, topic: str, message: Message, *, retain: bool = False) -> None:
        self._wire.publish(f"uagv/v2/NeNa/{serial}/{topic}", json.dumps(message).encode(), retain=retain)


def _timestamp() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def _header(serial: str) -> Message:
    return {
        "headerId": 0,
        "timestamp": _timestamp(),
        "version": "2.1.0",
        "manufacturer": "NeNa",
        "serialNumber": serial,
    }


def _position(x: float, y: float) -> Message:
    return {"x": x, "y": y, "theta": 0.0, "mapId": lanes.MAP_ID, "positionInitialized": True}


def _first_state(number: int) -> Message:
    return {
        **_header(lanes.robot(number)),
        "orderId": "",
        "orderUpdateId": 0,
        "lastNodeId": lanes.point(number, 0),
        "lastNodeSequenceId": 0,
        "nodeStates": [],
        "edgeStates": [],
        "driving": False,
        "paused": False,
        "actionStates": [],
        "batteryState": {"batteryCharge": 80.0, "charging": False},
        "operatingMode": "AUTOMATIC",
        "errors": [],
        "safetyState": {"eStop": "NONE", "fieldViolation": False},
        "agvPosition": _position(0.0, float(number * lanes.APART_M)),
    }


def _under_way() -> Message:
    return {
        "driving": True,
        "velocity": {"vx": 1.0, "vy": 0.0, "omega": 0.0},
        "nodeStates": [
            {
                "nodeId": f"node-{index}",
                "sequenceId": 2 * index,
                "released": True,
                "nodePosition": {"x": float(index), "y": 2.0, "theta": 0.0, "mapId": lanes.MAP_ID},
            }
            for index in range(1, ROUTE_NODES)
        ],
        "edgeStates": [
            {"edgeId": f"node-{index} --- node-{index + 1}", "sequenceId": 2 * index + 1, "released": True}
            for index in range(ROUTE_NODES - 1)
        ],
    }
