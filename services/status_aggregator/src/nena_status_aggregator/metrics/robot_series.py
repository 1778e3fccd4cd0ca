"""Metrics of single robots, written as text (Prometheus text format 0.0.4)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import hypot
from typing import Generic, TypeVar

from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.state import EmergencyStop, State
from nena_status_aggregator.fleet.robot import Robot, Timestamp
from nena_status_aggregator.fleet.view_builder import is_active

ESCAPES = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})


def labels_text(**labels: str) -> str:
    """Format labels, without braces."""
    return ",".join(f'{name}="{value.translate(ESCAPES)}"' for name, value in labels.items())


def head_lines(name: str, kind: str, text: str) -> str:
    """Format the head of a metric family; ``name`` is that of its samples."""
    return f"# HELP {name} {text}\n# TYPE {name} {kind}\n"


S = TypeVar("S", Robot, State)


@dataclass(frozen=True, slots=True)
class Series(Generic[S]):
    """A metric of each robot; ``value`` returns None if the robot currently has none."""

    name: str
    kind: str
    text: str
    value: Callable[[S, Timestamp], float | None]


def of_state(name: str, text: str, value: Callable[[State, Timestamp], float | None]) -> Series[State]:
    """Create a gauge that is read from a robot's last state."""
    return Series(name, "gauge", text, value)


def _round_seconds(seconds: float | None) -> float | None:
    return None if seconds is None else round(seconds, 3)


OF_ROBOT: tuple[Series[Robot], ...] = (
    Series(
        "nena_robot_connected",
        "gauge",
        "1 while the connection state is ONLINE.",
        lambda robot, _: (
            None
            if robot.connection is None
            else int(robot.connection.connection_state is ConnectionState.ONLINE)
        ),
    ),
    Series(
        "nena_robot_state_age_seconds",
        "gauge",
        "Time since the last state; absent before the first.",
        lambda robot, now: _round_seconds(robot.state_age(now)),
    ),
    Series(
        "nena_robot_condition_age_seconds",
        "gauge",
        "Time since the condition changed.",
        lambda robot, now: round(max(0.0, (now.utc - robot.condition_since).total_seconds()), 3),
    ),
    Series(
        "nena_robot_clock_skew_seconds",
        "gauge",
        "Robot clock minus aggregator clock.",
        lambda robot, _: _round_seconds(robot.skew.seconds),
    ),
    Series(
        "nena_robot_speed_meters_per_second",
        "gauge",
        "Speed over the ground, if reported.",
        lambda robot, _: (
            hypot(robot.velocity.vx or 0.0, robot.velocity.vy or 0.0) if robot.velocity else None
        ),
    ),
    Series(
        "nena_robot_order_progress_ratio",
        "gauge",
        "Progress of the order by nodes, 0 to 1; absent without an order.",
        lambda robot, _: robot.progress.percent / 100 if robot.state and robot.state.order_id else None,
    ),
    Series(
        "nena_robot_distance_meters_total",
        "counter",
        "Distance driven, by reported positions.",
        lambda robot, _: round(robot.odometer.meters, 2),
    ),
    Series("nena_robot_states_total", "counter", "States received and used.", lambda robot, _: robot.states),
    Series(
        "nena_robot_malformed_total",
        "counter",
        "Unreadable messages.",
        lambda robot, _: robot.malformed,
    ),
)

OF_STATE: tuple[Series[State], ...] = (
    of_state(
        "nena_robot_battery_ratio",
        "State of charge, 0 to 1.",
        lambda state, _: state.power_supply.state_of_charge / 100,
    ),
    of_state(
        "nena_robot_battery_volts",
        "Voltage, if reported.",
        lambda state, _: state.power_supply.battery_voltage,
    ),
    of_state(
        "nena_robot_range_meters", "Remaining range, if reported.", lambda state, _: state.power_supply.range
    ),
    of_state(
        "nena_robot_charging", "1 while the robot charges.", lambda state, _: int(state.power_supply.charging)
    ),
    of_state("nena_robot_driving", "1 while the robot drives.", lambda state, _: int(state.driving)),
    of_state("nena_robot_paused", "1 while the robot is paused.", lambda state, _: int(bool(state.paused))),
    of_state(
        "nena_robot_emergency_stop",
        "1 while an emergency stop is active.",
        lambda state, _: int(state.safety_state.active_emergency_stop is not EmergencyStop.NONE),
    ),
    of_state(
        "nena_robot_field_violation",
        "1 while the protective field is violated.",
        lambda state, _: int(state.safety_state.field_violation),
    ),
    of_state(
        "nena_robot_localized",
        "1 while the robot is localised.",
        lambda state, _: int(state.mobile_robot_position.localized) if state.mobile_robot_position else None,
    ),
    of_state(
        "nena_robot_order_active",
        "1 while the robot has an active order.",
        lambda state, _: int(is_active(state)),
    ),
    of_state("nena_robot_errors_active", "Active errors.", lambda state, _: len(state.errors)),
    of_state(
        "nena_robot_loads",
        "Loads on the robot, if reported.",
        lambda state, _: None if state.loads is None else len(state.loads),
    ),
)


def robot_families(robots: Iterable[Robot], now: Timestamp) -> str:
    """Return the metric families of all robots."""
    labelled = [
        (robot, labels_text(manufacturer=robot.key.manufacturer, serial_number=robot.key.serial_number))
        for robot in robots
    ]
    rows = [(robot, f"{{{labels}}} ") for robot, labels in labelled]
    states = [(robot.state, labels) for robot, labels in rows if robot.state is not None]
    # Only the current condition: one series per robot, not one per robot and condition.
    conditions = [f'{CONDITION}{{{labels},condition="{robot.condition}"}} 1\n' for robot, labels in labelled]
    families = [head_lines(CONDITION, "gauge", CONDITION_TEXT), *conditions]
    families += [_family_lines(series, rows, now) for series in OF_ROBOT]
    families += [_family_lines(series, states, now) for series in OF_STATE]
    return "".join(families)


CONDITION = "nena_robot_condition"
CONDITION_TEXT = "1 for the current condition; the others are absent."


def _family_lines(series: Series[S], rows: list[tuple[S, str]], now: Timestamp) -> str:
    name, value_of = series.name, series.value
    lines = [
        f"{name}{labels}{value}\n" for source, labels in rows if (value := value_of(source, now)) is not None
    ]
    return head_lines(name, series.kind, series.text) + "".join(lines)
