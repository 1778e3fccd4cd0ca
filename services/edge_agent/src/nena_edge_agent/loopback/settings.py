"""Settings of the loopback driver."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.settings import SettingsGroup

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class StartPose(SettingsGroup):
    """Start pose of a loopback robot, in the plant's frame."""

    x: Finite = Field(0.0, description="m")
    y: Finite = Field(0.0, description="m")
    theta: Finite = Field(0.0, description="rad")
    speed: Positive | None = Field(None, description="Speed of this robot, m/s. Unset: that of the others.")


class LoopbackSettings(SettingsGroup):
    """Loopback robots of this program."""

    count: int = Field(
        1, ge=1, le=10_000, description="Number of robots; above 1, their serial numbers are numbered."
    )
    x: Finite = Field(0.0, description="Start position of the first robot, m.")
    y: Finite = Field(0.0, description="Start position of the first robot, m.")
    theta: Finite = Field(0.0, description="Start heading, rad.")
    spacing: Finite = Field(2.0, description="Distance between robots (x) and between rows (y), m.")
    row: int = Field(0, ge=0, description="Robots per row; 0: all in one row.")
    starts: tuple[StartPose, ...] = Field(
        (),
        description="Start poses of the first robots, as [[loopback.starts]] tables; others start in rows.",
    )
    speed: Positive = Field(1.0, description="Speed, m/s.")
    turn_rate: Positive = Field(2.0, description="Turning speed, rad/s.")
    deceleration: float = Field(
        0.0, ge=0, allow_inf_nan=False, description="Deceleration when stopping, m/s²; 0: stops at once."
    )
    pose_interval: Positive = Field(0.2, description="Interval between poses while driving, seconds.")
    charge: float = Field(100.0, ge=0, le=100, description="State of charge at the start, percent.")
    drain: float = Field(1.0, ge=0, le=100, description="Charge used per 100 m of driving, percent.")
    charge_rate: Positive = Field(1.0, description="Charging speed, percent per second.")
    control: bool = Field(
        default=False,
        description="Enable simulation control: MQTT commands that simulate people and the environment.",
    )
    rehearsal: bool = Field(
        default=False, description="Add simulated actions, such as ones that fail or need a parameter."
    )
    power: bool = Field(
        default=False,
        description="Offer hibernation and shutdown (VDA 5050 3.0), also without commands in `power`.",
    )
    restarts: int = Field(5, ge=0, le=1000, description="Maximum restarts of a failed robot of a fleet.")
    restart_pause: Positive = Field(
        1.0, description="Delay before the first restart, seconds; doubles each time."
    )

    def start(self, index: int) -> StartPose:
        """Return the start pose of robot ``index``, counted from 0."""
        if index < len(self.starts):
            return self.starts[index]
        row, column = divmod(index, self.row or self.count)
        return StartPose(x=self.x + column * self.spacing, y=self.y + row * self.spacing, theta=self.theta)
