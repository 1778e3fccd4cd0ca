"""(b) Order on the wire to goal_pose over DDS, and (h) Nav2's terminal status to the state on the wire.

The far ends are one other process; a bare pass-through both ways is measured beside them, in turn.
"""

from __future__ import annotations

import json
import os
import queue
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from action_msgs.msg import GoalStatus

from bench.figures import Figures, milliseconds, ratio, within
from bench.helper import helper
from bench.nav2_stand_in import Nav2StandIn
from bench.wire import Wire
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition, Order
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.waiting import wait_until

WAIT_SECONDS = 30.0
QUIET_SECONDS = 0.12
"""Without a state for so long, the next one does not wait for the least time between two states."""
WARM_UP = 10
PASS_TOPIC = "bench/passthrough"
PASS_BACK_TOPIC = "bench/passthrough/state"
PASS_NAMESPACE = "passthrough"
MAP_ID = "bench"
SCHEME = TopicScheme("uagv")
TARGET = {"p50": 2.0, "p99": 3.0}
"""How many times as long as the bare pass-through each way may take."""

Place = tuple[str, float, float]
"""Name, x and y in m."""
PLACES: tuple[Place, Place] = (("Parking bay", 1.0, 7.0), ("Middle 1", 3.0, 7.0))


class FleetControl:
    """Orders for one robot, the states that it answers with, and the messages of the bare pass-through."""

    def __init__(self, port: int, robot: RobotKey) -> None:
        self._robot = robot
        self._states: queue.SimpleQueue[tuple[bytes, float]] = queue.SimpleQueue()
        self._passed: queue.SimpleQueue[float] = queue.SimpleQueue()
        topics = (SCHEME.of(robot, Topic.STATE), PASS_BACK_TOPIC)
        self.wire = Wire(port, f"bench-fleet-control-{robot.serial_number}", topics, self._on_message)

    def give_order(self, here: Place, there: Place) -> str:
        """Publish an order from one place to another; return its ID."""
        order_id = f"bench-{uuid.uuid4().hex[:8]}"
        payload = CODEC.encode(self._order(order_id, here, there))
        self.wire.publish(SCHEME.of(self._robot, Topic.ORDER), payload)
        return order_id

    def wait_until(self, found: Callable[[State], object]) -> tuple[bytes, float]:
        """Wait for a state of that kind; return it and its time of arrival."""
        end = time.perf_counter() + WAIT_SECONDS
        while time.perf_counter() < end:
            payload, moment = self._states.get(timeout=WAIT_SECONDS)
            if found(CODEC.decode(State, payload)):
                return payload, moment
        raise TimeoutError("no such state has come")

    def wait_until_quiet(self) -> None:
        """Wait until no state comes any more."""
        while True:
            try:
                self._states.get(timeout=QUIET_SECONDS)
            except queue.Empty:
                return

    def pass_on(self, place: Place) -> None:
        """Send a place through the bare pass-through."""
        self.wire.publish(PASS_TOPIC, json.dumps({"x": place[1], "y": place[2]}).encode())

    def passed_back(self) -> float:
        """Wait for a message of the bare pass-through, and return its time of arrival."""
        return self._passed.get(timeout=WAIT_SECONDS)

    def _on_message(self, topic: str, payload: bytes, moment: float) -> None:
        if topic == PASS_BACK_TOPIC:
            self._passed.put(moment)
        else:
            self._states.put((payload, moment))

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
                x=x, y=y, map_id=MAP_ID, allowed_deviation_xy=AllowedDeviationXY(a=0.6, b=0.6)
            ),
        )


class _Disk:
    """What a record of 16 KB on the disk costs: written over itself, and waited for."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / "disk").open("w+b", buffering=0)
        self._record = b"x" * 16384

    def write(self) -> float:
        """Write and sync; return the seconds."""
        start = time.perf_counter()
        os.pwrite(self._file.fileno(), self._record, 0)
        os.fdatasync(self._file.fileno())
        return time.perf_counter() - start

    def close(self) -> None:
        """Write no more."""
        self._file.close()


class _Run:
    """One order after the other, each there and back through the agent and through the pass-through."""

    def __init__(self, nav2: Nav2StandIn, fleet: FleetControl, namespace: str) -> None:
        self._nav2, self._fleet, self._namespace = nav2, fleet, namespace
        self.to_goal: list[float] = []
        self.bare_to_goal: list[float] = []
        self.to_state: list[float] = []
        self.bare_to_state: list[float] = []

    def drive(self, here: Place, there: Place) -> bytes:
        """Send one order through the agent; return the last state."""
        start = time.perf_counter()
        order_id = self._fleet.give_order(here, there)
        self.to_goal.append(self._nav2.goals[self._namespace].get(timeout=WAIT_SECONDS) - start)
        goal_id = list(uuid.uuid4().bytes)
        self._nav2.show(self._namespace, goal_id, GoalStatus.STATUS_EXECUTING)
        self._nav2.place(*there[1:])
        self._fleet.wait_until(lambda state: state.order_id == order_id)
        self._fleet.wait_until_quiet()
        start = time.perf_counter()
        self._nav2.show(self._namespace, goal_id, GoalStatus.STATUS_SUCCEEDED)
        payload, moment = self._fleet.wait_until(
            lambda state: state.order_id == order_id and not state.node_states
        )
        self.to_state.append(moment - start)
        self._fleet.wait_until_quiet()
        return payload

    def pass_through(self, there: Place) -> None:
        """Send the same through the bare pass-through."""
        start = time.perf_counter()
        self._fleet.pass_on(there)
        self.bare_to_goal.append(self._nav2.goals[PASS_NAMESPACE].get(timeout=WAIT_SECONDS) - start)
        self._fleet.wait_until_quiet()
        goal_id = list(uuid.uuid4().bytes)
        start = time.perf_counter()
        self._nav2.show(PASS_NAMESPACE, goal_id, GoalStatus.STATUS_SUCCEEDED)
        self.bare_to_state.append(self._fleet.passed_back() - start)
        self._fleet.wait_until_quiet()


def measure(
    port: int, domain_id: int, namespace: str, robot: RobotKey, *, samples: int, folder: Path
) -> dict[str, Any]:
    """Send orders through the agent and messages through the bare pass-through, one after the other."""
    fleet, disk = FleetControl(port, robot), _Disk(folder)
    on_disk: list[float] = []
    nav2 = Nav2StandIn(domain_id, (namespace, PASS_NAMESPACE))
    nav2.place(*PLACES[0][1:])
    try:
        run = _Run(nav2, fleet, namespace)
        fleet.wait_until(ready)
        size = len(run.drive(*PLACES))
        arguments = (str(port), str(domain_id), PASS_NAMESPACE, PASS_TOPIC, PASS_BACK_TOPIC, str(size))
        with helper("bench.passthrough", *arguments):
            wait_until(lambda: nav2.joined(PASS_NAMESPACE), what="the bare pass-through has joined")
            for number in range(WARM_UP + samples):
                here, there = PLACES if number % 2 else PLACES[::-1]
                run.drive(here, there)
                run.pass_through(there)
                on_disk.append(disk.write())
    finally:
        fleet.wire.close()
        nav2.close()
        disk.close()
    return {
        "state_bytes": size,
        "bare_record_on_disk": milliseconds(on_disk[-samples:]),
        "order_on_wire_to_goal_pose": _beside(run.to_goal[-samples:], run.bare_to_goal[-samples:]),
        "terminal_status_to_state_on_wire": _beside(run.to_state[-samples:], run.bare_to_state[-samples:]),
    }


def ready(state: State) -> object:
    """Return whether the robot is localised and reports no error."""
    position = state.mobile_robot_position
    return position and position.localized and not state.errors


def _beside(samples: list[float], bare: list[float]) -> dict[str, Figures]:
    figures, bare_figures = milliseconds(samples), milliseconds(bare)
    return {"agent": figures, "bare_pass_through": bare_figures, "ratio": ratio(figures, bare_figures)}


def medians(runs: Sequence[Mapping[str, Any]], figure: str) -> dict[str, Any]:
    """Return the medians of a figure over several runs, and whether the ratios meet the target."""
    agent, bare, ratios = (
        middle([run[figure][part] for run in runs]) for part in ("agent", "bare_pass_through", "ratio")
    )
    return {
        "agent": agent,
        "bare_pass_through": bare,
        "ratio": {key: within(value, TARGET[key]) for key, value in ratios.items()},
        "ratios_of_the_runs": [run[figure]["ratio"] for run in runs],
    }


def middle(runs: Sequence[Figures]) -> Figures:
    """Return the median of each figure over several runs."""
    return {key: round(median(run[key] for run in runs), 3) for key in runs[0]}
