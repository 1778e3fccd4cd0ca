from __future__ import annotations

from typing import Any

import pytest

from nena_demo.session import check_fleet, check_metrics
from nena_demo.stack import ROBOTS

ORDERS = {"first": "FINISHED", "second": "FINISHED"}


def fleet(**orders: str) -> dict[str, Any]:
    return {
        "orders": [{"name": name, "state": state} for name, state in orders.items()],
        "robots": [
            {"serialNumber": robot.serial_number, "condition": "IDLE", "reason": "has nothing to do"}
            for robot in ROBOTS
        ],
    }


def metrics(finished: int, *, connected: int = 1, robots: int = len(ROBOTS)) -> str:
    ages = "".join(
        f'nena_robot_state_age_seconds{{manufacturer="NeNa",serial_number="{robot.serial_number}"}} 0.1\n'
        for robot in ROBOTS[:robots]
    )
    return (
        "# TYPE nena_transport_orders_ended counter\n"
        f'nena_transport_orders_ended_total{{state="FINISHED"}} {finished}\n'
        f"# TYPE nena_mqtt_connected gauge\nnena_mqtt_connected {connected}\n"
        f"# TYPE nena_robot_state_age_seconds gauge\n{ages}"
    )


def test_agreement_is_silent() -> None:
    assert list(check_fleet(fleet(**ORDERS), ORDERS, ROBOTS)) == []
    assert list(check_metrics(metrics(2), ORDERS, ROBOTS)) == []


def test_order_in_another_state_or_missing_is_reported() -> None:
    problems = list(check_fleet(fleet(first="BEING_PROCESSED"), ORDERS, ROBOTS))

    assert problems == [
        "order first is shown as BEING_PROCESSED, not FINISHED",
        "order second is shown as None, not FINISHED",
    ]


def test_missing_or_busy_robot_is_reported_with_its_reason() -> None:
    seen = fleet(**ORDERS)
    seen["robots"] = [{"serialNumber": "robot-01", "condition": "SILENT", "reason": "no state for 40 s"}]

    assert list(check_fleet(seen, ORDERS, ROBOTS)) == [
        "robot robot-01 is SILENT: no state for 40 s",
        "robot robot-02 is not shown",
    ]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (metrics(1), "nena_transport_orders_ended_total counts 1 FINISHED orders, not 2"),
        (metrics(2, connected=0), "nena_mqtt_connected is not 1"),
        (metrics(2, robots=1), "nena_robot_state_age_seconds has no sample for robot-02"),
    ],
)
def test_differing_metrics_are_reported(text: str, problem: str) -> None:
    assert list(check_metrics(text, ORDERS, ROBOTS)) == [problem]
