"""The battery as sensor_msgs/BatteryState tells it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from nena_edge_agent.driver.port import BatteryReport
from nena_shared.log import get_logger

log = get_logger(__name__)

BatteryScale = Literal["fraction", "percent"]
"""How ``percentage`` is sent: 0 to 1 as the message defines it, or 0 to 100 as many drivers do."""

STATUS_CHARGING = 1
SUSPICIOUS_FRACTION = 1.5
"""A fraction above this is a sign that the driver sends percent."""


@dataclass(frozen=True, slots=True)
class BatteryReading:
    """What a message says: ``percentage`` in the driver's scale, V, A; NaN where it was not measured."""

    percentage: float
    voltage: float
    current: float
    status: int


class Battery:
    """Turns readings into reports; a scale that looks wrong is told once and never guessed."""

    def __init__(self, scale: BatteryScale) -> None:
        self._scale = scale
        self._warned = False

    def report(self, reading: BatteryReading) -> BatteryReport | None:
        """Give the report for a reading; none where the charge was not measured."""
        if not math.isfinite(reading.percentage):
            return None
        self._check_scale(reading.percentage)
        percent = reading.percentage * (100.0 if self._scale == "fraction" else 1.0)
        return BatteryReport(
            state_of_charge=min(100.0, max(0.0, percent)),
            charging=reading.status == STATUS_CHARGING,
            voltage=_measured(reading.voltage),
            current=_measured(reading.current),
        )

    def _check_scale(self, percentage: float) -> None:
        if self._scale == "fraction" and percentage > SUSPICIOUS_FRACTION and not self._warned:
            self._warned = True
            log.warning(
                "the battery's percentage is above 1: does the robot send percent? "
                "Then set ros.battery_scale to percent",
                percentage=percentage,
            )


def _measured(value: float) -> float | None:
    return value if math.isfinite(value) else None
