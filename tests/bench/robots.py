"""Robots of the benchmark: they answer orders at once, in VDA 5050 2.1, outside of the measured processes."""

from __future__ import annotations

import queue
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime

from bench.wire import Wire
from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import NodePosition, Order
from nena_shared.vda5050.state import EdgeState, MobileRobotPosition, NodeState, State, Velocity
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.fleet_examples import factsheet, position, state

SCHEME = TopicScheme("uagv")
WAY_LENGTH = 20
"""Nodes."""
STATE_INTERVAL = 25.0
"""Seconds between the states of a robot at rest; VDA 5050 requires one each 30 s."""
WAITING = ActionStatus.WAITING


@dataclass
class Start:
    """Start position of a robot: a point of the plant, m."""

    serial_number: str
    node_id: str
    x: float
    y: float
    map_id: str = "sample-hall"


class InstantRobots:
    """Robots that drive and act in no time, and repeat their states as VDA 5050 requires."""

    def __init__(self, port: int, starts: tuple[Start, ...], manufacturer: str = "NeNa") -> None:
        self.orders: queue.SimpleQueue[tuple[str, str, float]] = queue.SimpleQueue()
        """(serial number, orderId, moment of arrival) of each order as it comes."""
        self._manufacturer = manufacturer
        self._states = {start.serial_number: self._first_state(start) for start in starts}
        self._held: dict[str, tuple[str, bytes, float]] | None = None
        """By robot, its last order that has come since :meth:`hold`; others have ended where they began."""
        self._lock = threading.RLock()
        self._closed = threading.Event()
        self._wire = Wire(port, "bench-robots", (SCHEME.for_all(Topic.ORDER),), self._arrived)
        for serial in self._states:
            self._say_hello(serial)
        self._repeating = threading.Thread(target=self._repeat_states, name="bench states")
        self._repeating.start()

    def close(self) -> None:
        """Disconnect."""
        self._closed.set()
        self._repeating.join()
        self._wire.close()

    def hold(self) -> None:
        """Accept the next orders, but stay where they begin, so that others have to wait."""
        with self._lock:
            self._held = {}

    def go_on(self) -> None:
        """Drive again, first for the orders accepted meanwhile."""
        with self._lock:
            held, self._held = self._held or {}, None
            for each in held.values():
                self._on_order(*each)

    def taken(self, wait: float = 0.0) -> list[tuple[str, str, float]]:
        """Return the orders that have come since the last call; wait up to ``wait`` s for the first one."""
        found: list[tuple[str, str, float]] = []
        with suppress(queue.Empty):
            while True:
                found.append(self.orders.get(timeout=0.0 if found else wait))
        return found

    def say_state(self, serial: str) -> None:
        """Publish the robot's state."""
        with self._lock:
            before = self._states[serial]
            self._states[serial] = before.model_copy(
                update={"header_id": before.header_id + 1, "timestamp": datetime.now(UTC)}
            )
            self._publish(serial, Topic.STATE, self._states[serial])

    def _repeat_states(self) -> None:
        while True:
            for serial in self._states:
                if self._closed.wait(STATE_INTERVAL / len(self._states)):
                    return
                self.say_state(serial)

    def _arrived(self, topic: str, payload: bytes, moment: float) -> None:
        with self._lock:
            if self._held is None:
                self._on_order(topic, payload, moment)
            else:
                serial = topic.split("/")[-2]
                self._held[serial] = (topic, payload, moment)
                self._states[serial] = at_node(self._states[serial], CODEC.decode(Order, payload), 0)
                self.say_state(serial)

    def _on_order(self, topic: str, payload: bytes, moment: float) -> None:
        serial = topic.split("/")[-2]
        order = CODEC.decode(Order, payload)
        self.orders.put((serial, order.order_id, moment))
        last = order.nodes[-1]
        position = last.node_position
        before = self._states[serial]
        self._states[serial] = before.model_copy(
            update={
                "order_id": order.order_id,
                "order_update_id": order.order_update_id,
                "last_node_id": last.node_id,
                "last_node_sequence_id": last.sequence_id,
                "action_states": tuple(
                    ActionState(
                        action_id=action.action_id,
                        action_type=action.action_type,
                        action_status=ActionStatus.FINISHED,
                    )
                    for node in order.nodes
                    for action in node.actions
                ),
                "mobile_robot_position": MobileRobotPosition(
                    x=position.x, y=position.y, theta=0.0, map_id=position.map_id, localized=True
                )
                if position
                else before.mobile_robot_position,
            }
        )
        self.say_state(serial)

    def _say_hello(self, serial: str) -> None:
        online = Connection(
            header_id=0,
            timestamp=datetime.now(UTC),
            version="2.1.0",
            manufacturer=self._manufacturer,
            serial_number=serial,
            connection_state=ConnectionState.ONLINE,
        )
        # In this order nobody has to ask them for anything.
        self._publish(serial, Topic.FACTSHEET, _factsheet(RobotKey(self._manufacturer, serial)), retain=True)
        self.say_state(serial)
        self._publish(serial, Topic.CONNECTION, online, retain=True)

    def _publish(self, serial: str, topic: Topic, message: Header, *, retain: bool = False) -> None:
        name = SCHEME.of(RobotKey(self._manufacturer, serial), topic)
        self._wire.publish(name, CODEC.encode(message), retain=retain)

    def _first_state(self, start: Start) -> State:
        return state(
            0,
            robot=RobotKey(self._manufacturer, start.serial_number),
            last_node_id=start.node_id,
            mobile_robot_position={**position(start.x, start.y), "map_id": start.map_id},
        )


class BaseRobots(InstantRobots):
    """Robots that drive to the end of their base in no time, and wait there for more."""

    def _on_order(self, topic: str, payload: bytes, moment: float) -> None:
        serial = topic.split("/")[-2]
        order = CODEC.decode(Order, payload)
        if not order.order_update_id:
            self.orders.put((serial, order.order_id, moment))
        self._states[serial] = at_node(self._states[serial], order, released_of(order))
        self.say_state(serial)


def released_of(order: Order) -> int:
    """Return the index of the last node of the base."""
    return max(index for index, node in enumerate(order.nodes) if node.released)


def at_node(before: State, order: Order, index: int) -> State:
    """Return the state of a robot that stands at a node of its order, with the actions up to it done."""
    node, rest = order.nodes[index], order.nodes[index + 1 :]
    position = node.node_position
    return before.model_copy(
        update={
            "order_id": order.order_id,
            "order_update_id": order.order_update_id,
            "last_node_id": node.node_id,
            "last_node_sequence_id": node.sequence_id,
            "node_states": tuple(
                NodeState(
                    node_id=each.node_id,
                    sequence_id=each.sequence_id,
                    released=each.released,
                    node_position=each.node_position,
                )
                for each in rest
            ),
            "edge_states": tuple(
                EdgeState(edge_id=each.edge_id, sequence_id=each.sequence_id, released=each.released)
                for each in order.edges[index:]
            ),
            "action_states": tuple(
                ActionState(
                    action_id=action.action_id,
                    action_type=action.action_type,
                    action_status=ActionStatus.FINISHED if each.sequence_id <= node.sequence_id else WAITING,
                )
                for each in order.nodes
                for action in each.actions
            ),
            "mobile_robot_position": MobileRobotPosition(
                x=position.x, y=position.y, theta=0.0, map_id=position.map_id, localized=True
            )
            if position
            else before.mobile_robot_position,
        }
    )


class DrivingRobots(InstantRobots):
    """Robots that accept an order and are under way from then on; their states are long."""

    def messages(self, serial: str) -> bytes:
        """Return the robot's state, to be sent with other header IDs and places."""
        return CODEC.encode(self._states[serial])

    def _on_order(self, topic: str, payload: bytes, moment: float) -> None:
        serial = topic.split("/")[-2]
        order = CODEC.decode(Order, payload)
        self.orders.put((serial, order.order_id, moment))
        self._states[serial] = self._states[serial].model_copy(
            update={
                "order_id": order.order_id,
                "order_update_id": order.order_update_id,
                "driving": True,
                "node_states": node_states(),
                "edge_states": edge_states(),
                "velocity": Velocity(vx=1.0, vy=0.0, omega=0.0),
            }
        )
        self.say_state(serial)


def node_states() -> tuple[NodeState, ...]:
    """Return the remaining nodes of a long route."""
    return tuple(
        NodeState(
            node_id=f"node-{index}",
            sequence_id=2 * index,
            released=True,
            node_position=NodePosition(x=float(index), y=2.0, theta=0.0, map_id="sample-hall"),
        )
        for index in range(1, WAY_LENGTH)
    )


def edge_states() -> tuple[EdgeState, ...]:
    """Return the remaining edges of a long route."""
    return tuple(
        EdgeState(edge_id=f"node-{index} --- node-{index + 1}", sequence_id=2 * index + 1, released=True)
        for index in range(WAY_LENGTH - 1)
    )


def _factsheet(robot: RobotKey) -> Factsheet:
    """Make the factsheet of a robot that accepts orders at any rate."""
    made = factsheet(robot=robot)
    timing = made.protocol_limits.timing.model_copy(update={"minimum_order_interval": 0.0})
    limits = made.protocol_limits.model_copy(update={"timing": timing})
    return made.model_copy(update={"protocol_limits": limits})


def now() -> float:
    """Return the time on the clock of all measurements of a benchmark."""
    return time.perf_counter()
