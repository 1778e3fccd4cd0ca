"""How a differential-drive robot moves: towards a pose, within its limits, step by step."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from nena_robot_simulator.pose import Pose, wrap

TURN_IN_PLACE_ABOVE = math.radians(60.0)
"""A goal that lies further off the heading than this is turned to before driving."""
AT_PLACE = 0.05
"""Metres within which only the heading is still corrected."""
HEADING_GAIN = 3.0
"""Yaw rate per radian of heading error, 1/s; the acceleration limit smooths it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What the drive can do: m/s, m/s², rad/s, rad/s²."""

    speed: float
    acceleration: float
    yaw_rate: float
    yaw_acceleration: float


@dataclass(frozen=True, slots=True)
class Motion:
    """Where the robot is and how fast it goes: forward m/s, counter-clockwise rad/s."""

    pose: Pose
    speed: float = 0.0
    yaw_rate: float = 0.0

    @property
    def standing(self) -> bool:
        """Whether the robot stands still."""
        return self.speed == 0.0 and self.yaw_rate == 0.0


def step(motion: Motion, target: Pose | None, limits: Limits, dt: float, *, behind: float = 0.0) -> Motion:
    """Move for ``dt`` seconds towards ``target`` (same frame); without a target, brake to standstill.

    ``behind`` is how far the way goes on behind the target, m: above 0 it is passed and not stopped at.
    """
    wanted_speed, wanted_yaw_rate = (
        (0.0, 0.0) if target is None else _wanted(motion.pose, target, limits, behind)
    )
    speed = _approach(motion.speed, wanted_speed, limits.acceleration * dt)
    yaw_rate = _approach(motion.yaw_rate, wanted_yaw_rate, limits.yaw_acceleration * dt)
    heading = motion.pose.yaw + yaw_rate * dt / 2.0
    return replace(
        motion,
        pose=Pose(
            motion.pose.x + speed * math.cos(heading) * dt,
            motion.pose.y + speed * math.sin(heading) * dt,
            wrap(motion.pose.yaw + yaw_rate * dt),
        ),
        speed=speed,
        yaw_rate=yaw_rate,
    )


def _wanted(pose: Pose, target: Pose, limits: Limits, behind: float) -> tuple[float, float]:
    """Forward speed and yaw rate that lead to the target."""
    distance = pose.distance(target)
    if distance <= AT_PLACE and not behind:
        return 0.0, _turn(wrap(target.yaw - pose.yaw), limits)
    error = wrap(pose.bearing(target) - pose.yaw)
    turn = _turn(error, limits)
    if abs(error) > TURN_IN_PLACE_ABOVE:
        return 0.0, turn
    braking = math.sqrt(2.0 * limits.acceleration * (distance + behind))
    return min(limits.speed, braking) * math.cos(error), turn


def _turn(error: float, limits: Limits) -> float:
    """Yaw rate that takes the error away and can be braked in time."""
    braking = math.sqrt(2.0 * limits.yaw_acceleration * abs(error))
    return math.copysign(min(limits.yaw_rate, HEADING_GAIN * abs(error), braking), error)


def _approach(value: float, wanted: float, most: float) -> float:
    """Go from ``value`` towards ``wanted`` by at most ``most``."""
    return wanted if abs(wanted - value) <= most else value + math.copysign(most, wanted - value)
