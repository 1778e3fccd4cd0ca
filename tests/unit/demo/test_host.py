from __future__ import annotations

from typing import Any

import pytest

from nena_demo.host import can_work
from support.fleet_examples import vehicle_status


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({}, True),
        ({"errors": ("batteryLow (WARNING)",)}, True),
        ({"errors": ("navigationNotAvailable: Nav2 is not active",)}, False),
        ({"current_position": None}, False),
        ({"connection": "OFFLINE"}, False),
        ({"state": "EXECUTING"}, False),
    ],
)
def test_the_job_begins_with_robots_that_can_drive(fields: dict[str, Any], *, expected: bool) -> None:
    assert can_work(vehicle_status(**{"current_position": "South 1", **fields})) is expected
