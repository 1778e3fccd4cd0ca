from __future__ import annotations

import pytest
from prometheus_client.parser import text_string_to_metric_families

from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.robot import Robot, Timestamp
from nena_status_aggregator.metrics.robot_series import robot_families
from support.clocks import ManualClock
from support.fleet_examples import ROBOT, START, connection, position, way
from support.fleet_records import state

CLOCK = ManualClock(start=START)


def robot(key: RobotKey = ROBOT) -> Robot:
    return Robot(key, Timestamp.of(CLOCK))


def figures(*robots: Robot, after: float = 0.0) -> dict[str, dict[str, float]]:
    """Return what is written of each robot, by its serial number."""
    found: dict[str, dict[str, float]] = {each.key.serial_number: {} for each in robots}
    text = robot_families(robots, Timestamp.of(ManualClock(seconds=after, start=START)))
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            found[sample.labels["serial_number"]][sample.name] = sample.value
    return found


def test_figures_of_a_state() -> None:
    busy = robot()
    busy.on_connection(connection(), Timestamp.of(CLOCK))
    busy.on_state(
        state(
            order_id="o1",
            driving=True,
            paused=True,
            power_supply={
                "state_of_charge": 41.0,
                "charging": True,
                "battery_voltage": 48.2,
                "range": 900.0,
            },
            mobile_robot_position=position(1.0, 2.0, localized=False),
            velocity={"vx": 0.3, "vy": -0.4, "omega": 2.0},
            loads=({"load_id": "box"},),
            errors=({"error_type": "e", "error_level": "WARNING"},),
            safety_state={"active_emergency_stop": "REMOTE", "field_violation": True},
            **way("B", "C", first=4),
        ),
        Timestamp.of(CLOCK),
        retained=False,
    )

    assert figures(busy, after=12)["r1"] == {
        "nena_robot_condition": 1,
        "nena_robot_connected": 1,
        "nena_robot_state_age_seconds": 12,
        "nena_robot_condition_age_seconds": 12,
        "nena_robot_clock_skew_seconds": 0,
        "nena_robot_battery_ratio": 0.41,
        "nena_robot_battery_volts": 48.2,
        "nena_robot_range_meters": 900,
        "nena_robot_charging": 1,
        "nena_robot_driving": 1,
        "nena_robot_paused": 1,
        "nena_robot_emergency_stop": 1,
        "nena_robot_field_violation": 1,
        "nena_robot_localized": 0,
        "nena_robot_speed_meters_per_second": 0.5,
        "nena_robot_order_active": 1,
        "nena_robot_order_progress_ratio": pytest.approx(1 / 3, abs=0.001),
        "nena_robot_errors_active": 1,
        "nena_robot_loads": 1,
        "nena_robot_distance_meters_total": 0,
        "nena_robot_states_total": 1,
        "nena_robot_malformed_total": 0,
    }


def test_odd_names_are_escaped() -> None:
    odd = RobotKey("A\\C", 'r"2\nx')
    assert figures(robot(odd))[odd.serial_number]["nena_robot_condition"] == 1
