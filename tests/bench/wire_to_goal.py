"""(b) Order on the wire to goal_pose at another process over DDS, beside a bare pass-through in one run."""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import pairwise

from bench.figures import Figures, milliseconds, ratio
from bench.goal_listener import GoalListener
from bench.wire import Wire
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition, Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC

WAIT_SECONDS = 30.0
PASS_TOPIC = "bench/passthrough"
PASS_NAMESPACE = "passthrough"
SCHEME = TopicScheme("uagv")

Place = tuple[str, float, float]
"""Name, x and y in m."""


class AgentUnderTest:
    """Orders for one robot, and the states that it answers with."""

    def __init__(self, port: int, robot: RobotKey, map_id: str) -> None:
        self._robot, self._map_id = robot, map_id
        self._states: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        topics = (SCHEME.of(robot, Topic.STATE), PASS_TOPIC)
        self.wire = Wire(port, "bench-fleet-control", topics, self._on_message)

    def give_order(self, here: Place, there: Place) -> str:
        """Publish an order from one place to another; give its id."""
        order_id = f"bench-{uuid.uuid4().hex[:8]}"
        payload = CODEC.encode(self._order(order_id, here, there))
        self.wire.publish(SCHEME.of(self._robot, Topic.ORDER), payload)
        return order_id

    def wait_until_done(self, order_id: str) -> None:
        """Wait until a state shows the order done."""
        end = time.perf_counter() + WAIT_SECONDS
        while time.perf_counter() < end:
            state = CODEC.decode(State, self._states.get(timeout=WAIT_SECONDS))
            if state.order_id == order_id and not state.node_states and not state.driving:
                return
        raise TimeoutError(order_id)

    def wait_until_localized(self) -> None:
        """Wait until the robot knows where it is and reports no error."""
        end = time.perf_counter() + WAIT_SECONDS
        while time.perf_counter() < end:
            state = CODEC.decode(State, self._states.get(timeout=WAIT_SECONDS))
            position = state.mobile_robot_position
            if position and position.localized and not state.errors:
                return
        raise TimeoutError("the agent is not ready")

    def _on_message(self, topic: str, payload: bytes, _moment: float) -> None:
        if topic != PASS_TOPIC:
            self._states.put(payload)

    def _order(self, order_id: str, here: Place, there: Place) -> Order:
        nodes = tuple(self._node(place, 2 * index) for index, place in enumerate((here, there)))
        return Order(
            header_id=0,
            timestamp=datetime.now(UTC),
            version="2.1.0",
            manufacturer=self._robot.manufacturer,
            serial_number=self._robot.serial_number,
            order_id=order_id,
            order_update_id=0,
            nodes=nodes,
            edges=tuple(
                Edge(
                    edge_id=f"{one.node_id} --- {other.node_id}",
                    sequence_id=one.sequence_id + 1,
                    released=True,
                    actions=(),
                )
                for one, other in pairwise(nodes)
            ),
        )

    def _node(self, place: Place, sequence_id: int) -> Node:
        name, x, y = place
        return Node(
            node_id=name,
            sequence_id=sequence_id,
            released=True,
            actions=(),
            node_position=NodePosition(
                x=x, y=y, map_id=self._map_id, allowed_deviation_xy=AllowedDeviationXY(a=0.6, b=0.6)
            ),
        )


def measure(port: int, domain_id: int, namespace: str, robot: RobotKey, samples: int) -> dict[str, Figures]:
    """Send orders through the agent and messages through the bare pass-through, one after the other."""
    places: tuple[Place, Place] = (("Parking bay", 1.0, 7.0), ("Middle 1", 3.0, 7.0))
    listener = GoalListener(domain_id, (namespace, PASS_NAMESPACE))
    agent = AgentUnderTest(port, robot, "sample-hall")
    through_agent, bare = [], []
    try:
        with _passthrough(port, domain_id):
            agent.wait_until_localized()
            _wait_for_publishers(listener, (namespace, PASS_NAMESPACE))
            for number in range(samples + 1):
                here, there = places if number % 2 == 0 else places[::-1]
                start = time.perf_counter()
                order_id = agent.give_order(here, there)
                through_agent.append(listener.arrivals[namespace].get(timeout=WAIT_SECONDS) - start)
                agent.wait_until_done(order_id)
                start = time.perf_counter()
                agent.wire.publish(PASS_TOPIC, json.dumps({"x": there[1], "y": there[2]}).encode())
                bare.append(listener.arrivals[PASS_NAMESPACE].get(timeout=WAIT_SECONDS) - start)
    finally:
        agent.wire.close()
        listener.close()
    agent_figures, bare_figures = milliseconds(through_agent[1:]), milliseconds(bare[1:])
    return {
        "order_on_wire_to_goal_pose": agent_figures,
        "bare_pass_through": bare_figures,
        "ratio": ratio(agent_figures, bare_figures),
    }


def _wait_for_publishers(listener: GoalListener, namespaces: tuple[str, ...]) -> None:
    end = time.perf_counter() + WAIT_SECONDS
    while not all(listener.publishers(name) for name in namespaces):
        if time.perf_counter() > end:
            raise TimeoutError("no publisher of goal_pose")


@contextmanager
def _passthrough(port: int, domain_id: int) -> Iterator[None]:
    module = ("-m", "bench.passthrough")
    command = [sys.executable, *module, str(port), str(domain_id), PASS_NAMESPACE, PASS_TOPIC]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        if process.stdout.readline() != "ready\n":
            raise RuntimeError("the bare pass-through did not start")
        yield
    finally:
        process.communicate(timeout=WAIT_SECONDS)
