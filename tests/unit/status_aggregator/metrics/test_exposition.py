from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.metrics_core import Metric
from prometheus_client.parser import text_string_to_metric_families

from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.metrics import Metric as Documented
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.metrics.exposition import SECTIONS, Exposition
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, JamSettings
from reference.metrics import robot_metrics
from support.certificates import Authority
from support.clocks import ManualClock
from support.fleet_examples import ROBOT, START, connection, order_status, position, vehicle_status
from support.fleet_records import state

PARTS_OF_HISTOGRAM = {"le"}


@pytest.fixture
def aggregator(tmp_path: Path) -> Aggregator:
    """Return an aggregator that has received one of everything."""
    certificate, key = Authority(tmp_path).sign("aggregator")
    settings = AggregatorSettings(
        jam=JamSettings(robots=0, seconds=0),
        http=AggregatorHttpSettings(tls_certificate=certificate, tls_key=key),
    )
    made = Aggregator(settings, ManualClock(start=START))
    model, now = made.model, made.now()
    broken = RobotKey("ACME", 'r"2\\')
    model.on_state(
        ROBOT,
        state(
            order_id="o1",
            last_node_id="A",
            power_supply={
                "state_of_charge": 41.0,
                "charging": True,
                "battery_voltage": 48.2,
                "range": 900.0,
            },
            mobile_robot_position=position(1.0, 2.0),
            velocity={"vx": 0.3, "vy": -0.4},
            loads=({"load_id": "box"},),
            errors=({"error_type": "orderError", "error_level": "WARNING"},),
        ),
        now,
    )
    model.on_connection(broken, connection("CONNECTION_BROKEN", robot=broken), now)
    for name, other in (("V-1", "V-2"), ("V-2", "V-1"), ("V-3", "V-4")):
        waits = RobotKey("ACME", name)
        wait = TrafficWait(vehicles=(other,), at="B", cause=WaitCause.PASSES, reason="it waits")
        model.on_state(waits, state(robot=waits), now)
        model.on_vehicle_status(vehicle_status(name, robot=waits, transport_order="T", wait=wait), now)
    model.on_malformed(MessageKind.STATE, "t", "p", now)
    model.statistics.repaired = {("state.agvPosition.theta", "angle_wrapped"): 3}
    model.on_order_status(order_status("living"), now)
    model.on_order_status(
        order_status("ended", state=TransportOrderState.FINISHED, finished=START.replace(minute=1)),
        now,
    )
    made.publish_changes()
    return made


def exposed(aggregator: Aggregator) -> str:
    return Exposition(aggregator).text().decode()


def families(aggregator: Aggregator) -> Iterator[Metric]:
    for family in text_string_to_metric_families(exposed(aggregator)):
        if family.name.startswith("nena_"):
            yield family


def value(aggregator: Aggregator, name: str, **labels: str) -> float | None:
    for family in families(aggregator):
        for sample in family.samples:
            if sample.name == name and sample.labels == labels:
                return float(sample.value)
    return None


def test_documented_metrics_equal_the_exposed_ones(aggregator: Aggregator) -> None:
    tables: list[Documented[Any]] = [each for section in SECTIONS for each in section.metrics]
    tables += robot_metrics()
    found = {
        f"{family.name}_total" if family.type == "counter" else family.name: (
            family.type,
            frozenset(label for each in family.samples for label in each.labels) - PARTS_OF_HISTOGRAM,
        )
        for family in families(aggregator)
    }
    assert found == {each.name: (each.kind.value, frozenset(each.labels)) for each in tables}


def test_robots_by_condition(aggregator: Aggregator) -> None:
    assert value(aggregator, "nena_robots", condition="CHARGING") == 1
    assert value(aggregator, "nena_robots", condition="BROKEN") == 1
    assert value(aggregator, "nena_robots", condition="WAITING") == 3
    assert value(aggregator, "nena_robots", condition="IDLE") == 0


def test_a_jam_is_counted_by_its_head_or_its_circle(aggregator: Aggregator) -> None:
    assert value(aggregator, "nena_jam_robots", head="V-4", kind="vehicle") == 1
    assert value(aggregator, "nena_jam_robots", head="V-1, V-2", kind="circle") == 2


def test_errors_messages_and_orders(aggregator: Aggregator) -> None:
    error = {"error_type": "orderError", "error_level": "WARNING"}
    assert value(aggregator, "nena_robot_errors", **error) == 1
    assert value(aggregator, "nena_robot_errors_raised_total", **error) == 1
    assert value(aggregator, "nena_messages_received_total", topic="state") == 5
    assert value(aggregator, "nena_messages_malformed_total", topic="state") == 1
    assert value(aggregator, "nena_transport_orders", state="BEING_PROCESSED") == 1
    assert value(aggregator, "nena_transport_orders_ended_total", state="FINISHED") == 1
    assert value(aggregator, "nena_mqtt_connected") == 0


def test_durations_are_a_histogram(aggregator: Aggregator) -> None:
    name = "nena_transport_order_duration_seconds"
    assert value(aggregator, f"{name}_bucket", state="FINISHED", le="30.0") == 0
    assert value(aggregator, f"{name}_bucket", state="FINISHED", le="60.0") == 1
    assert value(aggregator, f"{name}_bucket", state="FINISHED", le="+Inf") == 1
    assert value(aggregator, f"{name}_sum", state="FINISHED") == 60


def test_prometheus_accepts_the_metrics(aggregator: Aggregator) -> None:
    promtool = shutil.which("promtool")
    if promtool is None:
        pytest.skip("promtool is not there: apt-get install prometheus")
    result = subprocess.run(
        [promtool, "check", "metrics"],
        input=exposed(aggregator),
        text=True,
        capture_output=True,
        timeout=30,
        check=False,
    )
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")
