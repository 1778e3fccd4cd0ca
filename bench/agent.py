"""The edge agent on ROS: latencies, CPU at rest, start and memory, beside bare rclpy and paho.

Nav2 and AMCL are played by the benchmark, so that their load is known.
"""

from __future__ import annotations

import json
import queue
import time
import uuid
from collections.abc import Callable
from statistics import median
from typing import Any

from action_msgs.msg import GoalStatus

from bench.nav2_stand_in import Nav2StandIn
from bench.programs import Figures, Site, Version, cpu_of, memory_of, percentiles, running_site, yardstick
from bench.wire import Wire
from support.pausing import pass_time
from support.waiting import wait_until

DOMAIN_ID = 78
NAMESPACE, PASS_NAMESPACE = "r1", "pass"
PASS_TOPIC, PASS_ANSWER = "bench/pass", "bench/pass/state"
ROBOT = "uagv/v2/NeNa/robot-01"
MAP_ID = "bench"
PLACES = (("Parking bay", 1.0, 7.0), ("Middle 1", 3.0, 7.0))
WAIT_SECONDS = 30.0
QUIET_SECONDS = 0.12
"""Without a state for so long, the next one does not wait for the least time between two states."""
WARM_UP, ORDERS, STARTS = 10, 150, 5
SETTLE_SECONDS, IDLE_SECONDS = 3.0, 15.0

State = dict[str, Any]
Place = tuple[str, float, float]


class _FleetControl:
    """Sends orders to the robot and the yardstick, and receives their answers."""

    def __init__(self, port: int) -> None:
        self._states: queue.SimpleQueue[tuple[State, int, float]] = queue.SimpleQueue()
        self.passed: queue.SimpleQueue[float] = queue.SimpleQueue()
        """Moments at which the yardstick answered."""
        self.online: queue.SimpleQueue[float] = queue.SimpleQueue()
        """Moments at which the agent said that it is ONLINE."""
        topics = (f"{ROBOT}/state", f"{ROBOT}/connection", PASS_ANSWER)
        self.wire = Wire(port, "bench-fleet-control", topics, self._receive)

    def send_order(self, here: Place, there: Place) -> str:
        """Send an order from one place to another; return its ID."""
        order_id = f"bench-{uuid.uuid4().hex[:8]}"
        self.wire.publish(f"{ROBOT}/order", json.dumps(_order(order_id, here, there)).encode())
        return order_id

    def wait_for_state(self, wanted: Callable[[State], object]) -> tuple[int, float]:
        """Wait for such a state; return its size and its moment."""
        end = time.perf_counter() + WAIT_SECONDS
        while time.perf_counter() < end:
            state, size, moment = self._states.get(timeout=WAIT_SECONDS)
            if wanted(state):
                return size, moment
        raise TimeoutError("no such state has come")

    def wait_until_quiet(self) -> None:
        """Wait until no state comes any more."""
        while True:
            try:
                self._states.get(timeout=QUIET_SECONDS)
            except queue.Empty:
                return

    def _receive(self, topic: str, payload: bytes, moment: float) -> None:
        if topic == PASS_ANSWER:
            self.passed.put(moment)
            return
        message = json.loads(payload)
        if topic.endswith("/state"):
            self._states.put((message, len(payload), moment))
        elif message["connectionState"] == "ONLINE":
            self.online.put(moment)


def _order(order_id: str, *places: Place) -> dict[str, Any]:
    (first, *_), (last, *_) = places
    return {
        "headerId": 0,
        "timestamp": "2026-01-01T00:00:00Z",
        "version": "2.1.0",
        "manufacturer": "NeNa",
        "serialNumber": "robot-01",
        "orderId": order_id,
        "orderUpdateId": 0,
        "nodes": [
            {
                "nodeId": name,
                "sequenceId": 2 * index,
                "released": True,
                "actions": [],
                "nodePosition": {"x": x, "y": y, "mapId": MAP_ID, "allowedDeviationXY": 0.6},
            }
            for index, (name, x, y) in enumerate(places)
        ],
        "edges": [
            {
                "edgeId": f"{first} --- {last}",
                "sequenceId": 1,
                "released": True,
                "startNodeId": first,
                "endNodeId": last,
                "actions": [],
            }
        ],
    }


def _localised(state: State) -> object:
    return state.get("agvPosition", {}).get("positionInitialized") and not state["errors"]


def _start_agent(site: Site) -> int:
    configuration = site.folder / "agent.toml"
    configuration.write_text(
        f"""\
manufacturer = "NeNa"
serial_number = "robot-01"
map_id = "{MAP_ID}"
driver = "nav2"
journal = {{ folder = "{site.folder / "journal"}" }}
interval = {{ state_maximum = 1.0 }}
[ros]
namespace = "{NAMESPACE}"
domain_id = {DOMAIN_ID}
""",
        encoding="utf-8",
    )
    return site.start("edge-agent", site.version.program("nena-edge-agent"), "--config", str(configuration))


def measure_agent(version: Version) -> Figures:
    """Return start, latencies, CPU at rest with poses and odometry at 20 Hz, and memory."""
    with running_site(version) as site:
        fleet = _FleetControl(site.broker_port)
        try:
            figures = _starts(site, fleet)
            pid = _start_agent(site)
            figures |= _latencies(site, fleet)
            figures["memory_mb"] = memory_of(pid)
            figures |= _at_rest(pid, fleet)
        finally:
            fleet.wire.close()
    return figures


def _starts(site: Site, fleet: _FleetControl) -> Figures:
    """Start the agent and the yardstick in turn."""
    agent, bare = [], []
    for _ in range(STARTS):
        begin = time.perf_counter()
        _start_agent(site)
        agent.append(fleet.online.get(timeout=WAIT_SECONDS) - begin)
        site.stop("edge-agent")
        begin = time.perf_counter()
        with yardstick("bench.bare_ros", "listen", str(DOMAIN_ID), NAMESPACE):
            bare.append(time.perf_counter() - begin)
    return {"start_to_online_s": median(agent), "bare_start_s": median(bare)}


def _latencies(site: Site, fleet: _FleetControl) -> Figures:
    """Send orders through the agent and messages through the yardstick, one after the other."""
    to_goal: dict[str, list[float]] = {NAMESPACE: [], PASS_NAMESPACE: []}
    to_state: dict[str, list[float]] = {NAMESPACE: [], PASS_NAMESPACE: []}
    nav2 = Nav2StandIn(DOMAIN_ID, (NAMESPACE, PASS_NAMESPACE))
    nav2.place(*PLACES[0][1:])

    def drive(here: Place, there: Place) -> int:
        start = time.perf_counter()
        order_id = fleet.send_order(here, there)
        to_goal[NAMESPACE].append(nav2.goals[NAMESPACE].get(timeout=WAIT_SECONDS) - start)
        goal_id = list(uuid.uuid4().bytes)
        nav2.show(NAMESPACE, goal_id, GoalStatus.STATUS_EXECUTING)
        nav2.place(*there[1:])
        fleet.wait_for_state(lambda state: state["orderId"] == order_id)
        fleet.wait_until_quiet()
        start = time.perf_counter()
        nav2.show(NAMESPACE, goal_id, GoalStatus.STATUS_SUCCEEDED)
        size, moment = fleet.wait_for_state(lambda state: not state["nodeStates"])
        to_state[NAMESPACE].append(moment - start)
        fleet.wait_until_quiet()
        return size

    def pass_through(there: Place) -> None:
        start = time.perf_counter()
        fleet.wire.publish(PASS_TOPIC, json.dumps({"x": there[1], "y": there[2]}).encode())
        to_goal[PASS_NAMESPACE].append(nav2.goals[PASS_NAMESPACE].get(timeout=WAIT_SECONDS) - start)
        fleet.wait_until_quiet()
        start = time.perf_counter()
        nav2.show(PASS_NAMESPACE, list(uuid.uuid4().bytes), GoalStatus.STATUS_SUCCEEDED)
        to_state[PASS_NAMESPACE].append(fleet.passed.get(timeout=WAIT_SECONDS) - start)
        fleet.wait_until_quiet()

    try:
        fleet.wait_for_state(_localised)
        size = drive(*PLACES)
        bare = ("pass", str(DOMAIN_ID), PASS_NAMESPACE, str(site.broker_port), PASS_TOPIC, PASS_ANSWER)
        with yardstick("bench.bare_ros", *bare, str(size)):
            wait_until(lambda: nav2.joined(PASS_NAMESPACE), what="the yardstick has joined")
            for number in range(WARM_UP + ORDERS):
                here, there = PLACES if number % 2 else PLACES[::-1]
                drive(here, there)
                pass_through(there)
    finally:
        nav2.close()
    return {
        **percentiles("order_to_goal", to_goal[NAMESPACE][-ORDERS:]),
        **percentiles("bare_order_to_goal", to_goal[PASS_NAMESPACE][-ORDERS:]),
        **percentiles("status_to_state", to_state[NAMESPACE][-ORDERS:]),
        **percentiles("bare_status_to_state", to_state[PASS_NAMESPACE][-ORDERS:]),
    }


def _at_rest(pid: int, fleet: _FleetControl) -> Figures:
    """Measure a robot at standstill that sends a state a second."""
    nav2 = Nav2StandIn(DOMAIN_ID, (NAMESPACE,))
    try:
        with yardstick("bench.bare_ros", "listen", str(DOMAIN_ID), NAMESPACE) as bare:
            fleet.wait_for_state(_localised)
            pass_time(SETTLE_SECONDS)
            cpu, bare_cpu = cpu_of(pid), cpu_of(bare)
            pass_time(IDLE_SECONDS)
            return {
                "at_rest_cpu_percent": (cpu_of(pid) - cpu) / IDLE_SECONDS * 100,
                "bare_at_rest_cpu_percent": (cpu_of(bare) - bare_cpu) / IDLE_SECONDS * 100,
            }
    finally:
        nav2.close()
