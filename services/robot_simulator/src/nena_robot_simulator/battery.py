"""A battery that driving empties."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Scale = Literal["fraction", "percent"]

FULL_VOLTAGE = 27.2
EMPTY_VOLTAGE = 22.0
DRIVING_CURRENT = 6.0
IDLE_CURRENT = 0.8


@dataclass(slots=True, kw_only=True)
class Battery:
    """State of charge between 0 and 1, and what takes from it: per metre driven and per second anyway."""

    charge: float
    per_metre: float
    per_second: float
    driving: bool = False

    def drain(self, metres: float, seconds: float) -> None:
        """Take what ``metres`` of driving in ``seconds`` cost; an empty battery stays empty."""
        self.driving = metres > 0.0
        self.charge = max(0.0, self.charge - metres * self.per_metre - seconds * self.per_second)

    def percentage(self, scale: Scale) -> float:
        """Charge as sensor_msgs/BatteryState defines it (0 to 1), or 0 to 100 as many drivers send it."""
        return self.charge if scale == "fraction" else self.charge * 100.0

    @property
    def voltage(self) -> float:
        """Volts."""
        return EMPTY_VOLTAGE + (FULL_VOLTAGE - EMPTY_VOLTAGE) * self.charge

    @property
    def current(self) -> float:
        """Amperes, negative as the battery discharges."""
        return -(DRIVING_CURRENT if self.driving else IDLE_CURRENT)
