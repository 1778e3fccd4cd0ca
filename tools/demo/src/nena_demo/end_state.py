"""What the aggregator must show when the main job is done, read as any client would read it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from prometheus_client.parser import text_string_to_metric_families

from nena_demo.stack import DemoRobot


def check_fleet(
    fleet: Mapping[str, Any], expected: Mapping[str, str], robots: Sequence[DemoRobot]
) -> Iterator[str]:
    """Compare ``/api/v1/fleet`` with the orders' states and the robots; yield each difference in words."""
    shown = {order["name"]: order["state"] for order in fleet["orders"]}
    for name, state in expected.items():
        if shown.get(name) != state:
            yield f"order {name} is shown as {shown.get(name)}, not {state}"
    conditions = {robot["serialNumber"]: robot for robot in fleet["robots"]}
    for robot in robots:
        seen = conditions.get(robot.serial_number)
        if seen is None:
            yield f"robot {robot.serial_number} is not shown"
        elif seen["condition"] != "IDLE":
            yield f"robot {robot.serial_number} is {seen['condition']}: {seen['reason']}"


def check_metrics(text: str, expected: Mapping[str, str], robots: Sequence[DemoRobot]) -> Iterator[str]:
    """Compare ``/metrics`` with the orders' ends and the number of robots; yield each difference in words."""
    samples = {
        (sample.name, sample.labels.get("state", ""), sample.labels.get("serial_number", "")): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }
    for state in set(expected.values()):
        wanted = sum(1 for each in expected.values() if each == state)
        counted = samples.get(("nena_transport_orders_ended_total", state, ""), 0)
        if counted != wanted:
            yield f"nena_transport_orders_ended_total counts {counted:.0f} {state} orders, not {wanted}"
    if samples.get(("nena_mqtt_connected", "", "")) != 1:
        yield "nena_mqtt_connected is not 1"
    for robot in robots:
        if not any(
            name == "nena_robot_state_age_seconds" and serial == robot.serial_number
            for name, _, serial in samples
        ):
            yield f"nena_robot_state_age_seconds does not tell of {robot.serial_number}"
