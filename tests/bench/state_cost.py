"""(c) CPU per state in order service and aggregator, beside a bare subscriber that only parses JSON."""

from __future__ import annotations

import time
from datetime import UTC, datetime

from bench.bare_subscriber import bare_subscriber
from bench.figures import Figures
from bench.process import cpu_of_each
from bench.robots import edge_states, node_states
from bench.wire import Wire
from nena_shared.vda5050.state import (
    EmergencyStop,
    MobileRobotPosition,
    OperatingMode,
    PowerSupply,
    SafetyState,
    State,
    Velocity,
)
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.pausing import pass_time

SCHEME = TopicScheme("uagv")
ROBOTS = 50
RATE = 500.0
"""States per second over all robots."""

SETTLE_SECONDS = 2.0


def measure(port: int, services: dict[str, int], seconds: float) -> dict[str, Figures]:
    """Publish states of 4 KB for ``seconds``; return the CPU per state of each process (name to pid)."""
    with bare_subscriber(port) as bare:
        return _measure(port, {**services, "bare_subscriber": bare.pid}, seconds)


def _measure(port: int, processes: dict[str, int], seconds: float) -> dict[str, Figures]:
    wire = Wire(port, "bench-states", ())
    for number in range(ROBOTS):
        publish(wire, number, 0)
    pass_time(SETTLE_SECONDS)
    start = cpu_of_each(processes)
    pass_time(seconds)
    between = cpu_of_each(processes)
    sent = _publish_states(wire, seconds)
    pass_time(seconds - sent / RATE + SETTLE_SECONDS)
    end = cpu_of_each(processes)
    wire.close()
    idle_per_second = {name: (between[name] - start[name]) / seconds for name in processes}
    return {
        name: {
            "cpu_us_per_state": round(
                (end[name] - between[name] - idle_per_second[name] * (seconds + SETTLE_SECONDS)) / sent * 1e6,
                1,
            ),
            "states": sent,
            "state_bytes": len(payload(0, 1)),
        }
        for name in processes
    }


def _publish_states(wire: Wire, seconds: float) -> int:
    """Publish at the set rate, in small batches; return the number."""
    start = time.perf_counter()
    sent = 0
    while (elapsed := time.perf_counter() - start) < seconds:
        while sent < elapsed * RATE:
            publish(wire, sent % ROBOTS, 1 + sent // ROBOTS)
            sent += 1
        pass_time(0.002)
    return sent


def publish(wire: Wire, number: int, header_id: int) -> None:
    """Publish a state of robot ``number``."""
    robot = RobotKey("Bench", f"bench-{number:03d}")
    wire.publish(SCHEME.of(robot, Topic.STATE), payload(number, header_id))


def payload(number: int, header_id: int) -> bytes:
    """Return a state of a robot under way."""
    x = (header_id % 100) / 10
    state = State(
        header_id=header_id,
        timestamp=datetime.now(UTC),
        version="2.1.0",
        manufacturer="Bench",
        serial_number=f"bench-{number:03d}",
        order_id="bench-order",
        order_update_id=0,
        last_node_id="node-0",
        last_node_sequence_id=0,
        node_states=node_states(),
        edge_states=edge_states(),
        velocity=Velocity(vx=1.0, vy=0.0, omega=0.0),
        loads=(),
        driving=True,
        paused=False,
        action_states=(),
        instant_action_states=(),
        power_supply=PowerSupply(state_of_charge=80.0, battery_voltage=48.2, charging=False, range=9000.0),
        operating_mode=OperatingMode.AUTOMATIC,
        errors=(),
        safety_state=SafetyState(active_emergency_stop=EmergencyStop.NONE, field_violation=False),
        mobile_robot_position=MobileRobotPosition(
            x=x, y=2.0, theta=0.0, map_id="sample-hall", localized=True
        ),
    )
    return CODEC.encode(state)
