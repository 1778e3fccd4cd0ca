"""Battery, and localisation like AMCL's."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Literal

from nena_robot_simulator.motion import Pose
from nena_shared.ros import wrap

Scale = Literal["fraction", "percent"]

FULL_VOLTAGE = 27.2
EMPTY_VOLTAGE = 22.0
DRIVING_CURRENT = 6.0
IDLE_CURRENT = 0.8
CHARGING_CURRENT = 10.0
"""Currents, A; sensor_msgs/BatteryState: negative when discharging."""


@dataclass(slots=True, kw_only=True)
class Battery:
    """State of charge (0 to 1), drained per metre driven and per second."""

    charge: float
    per_metre: float
    per_second: float
    driving: bool = False

    def drain(self, metres: float, seconds: float) -> None:
        """Drain for ``metres`` driven within ``seconds``; an empty battery stays empty."""
        self.driving = metres > 0.0
        self.charge = max(0.0, self.charge - metres * self.per_metre - seconds * self.per_second)

    def percentage(self, scale: Scale) -> float:
        """Return the charge, 0 to 1 as in sensor_msgs/BatteryState, or 0 to 100 as many drivers send it."""
        return self.charge if scale == "fraction" else self.charge * 100.0

    @property
    def voltage(self) -> float:
        """Voltage, V."""
        return EMPTY_VOLTAGE + (FULL_VOLTAGE - EMPTY_VOLTAGE) * self.charge

    @property
    def current(self) -> float:
        """Current, A; negative because the battery discharges."""
        return -(DRIVING_CURRENT if self.driving else IDLE_CURRENT)


UPDATE_DISTANCE = 0.25
"""Metres of driving after which the filter runs (``update_min_d``)."""
UPDATE_ANGLE = 0.2
"""Radians of turning after which the filter runs (``update_min_a``)."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A pose in the map frame with the variances of position (m²) and heading (rad²)."""

    pose: Pose
    xy_variance: float
    yaw_variance: float


class Localisation:
    """AMCL's behaviour: no estimates until a pose is known, and none at standstill.

    ``xy_deviation`` (m) and ``yaw_deviation`` (rad) are the standard deviations of each estimate.
    """

    def __init__(
        self, *, known: bool, xy_deviation: float, yaw_deviation: float, noise: random.Random
    ) -> None:
        self._known = known
        self._xy_deviation = xy_deviation
        self._yaw_deviation = yaw_deviation
        self._noise = noise
        self._last: Pose | None = None
        self._forced = False

    @property
    def known(self) -> bool:
        """Whether the robot is localised."""
        return self._known

    def initialise(self) -> None:
        """Accept an initial pose; the next scan yields an estimate."""
        self._known, self._last = True, None

    def forget(self) -> None:
        """Forget the robot's pose, like a restarted process."""
        self._known = False

    def force(self) -> None:
        """Run the filter on the next scan even at standstill (``request_nomotion_update``)."""
        self._forced = True

    def scan(self, true: Pose) -> Estimate | None:
        """Return the estimate after a laser scan at the true pose; None if the filter does not run."""
        if not self._known or not (self._forced or self._last is None or _has_moved(self._last, true)):
            return None
        self._last, self._forced = true, False
        return Estimate(self._blur_pose(true), self._xy_deviation**2, self._yaw_deviation**2)

    def _blur_pose(self, true: Pose) -> Pose:
        return Pose(
            self._noise.gauss(true.x, self._xy_deviation),
            self._noise.gauss(true.y, self._xy_deviation),
            wrap(self._noise.gauss(true.yaw, self._yaw_deviation)),
        )


def _has_moved(last: Pose, true: Pose) -> bool:
    """Return whether the robot has moved far enough for the filter to run."""
    return last.distance(true) > UPDATE_DISTANCE or abs(wrap(true.yaw - last.yaw)) > UPDATE_ANGLE
