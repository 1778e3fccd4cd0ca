"""Settings of the loopback driver."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from nena_shared.settings import SettingsGroup

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class StartPose(SettingsGroup):
    """Where a loopback robot stands at first, in the plant's frame."""

    x: Finite = Field(0.0, description="m")
    y: Finite = Field(0.0, description="m")
    theta: Finite = Field(0.0, description="rad")
    speed: Positive | None = Field(None, description="m/s of this robot; none: as the others.")


class LoopbackSettings(SettingsGroup):
    """The loopback robots of this program."""

    count: int = Field(1, ge=1, le=10_000, description="How many robots; above 1 their serials are numbered.")
    x: Finite = Field(0.0, description="Where the first robot stands at the start, m.")
    y: Finite = Field(0.0, description="Where the first robot stands at the start, m.")
    theta: Finite = Field(0.0, description="Heading at the start, rad.")
    spacing: Finite = Field(2.0, description="Metres in x from each robot to the next, in y from row to row.")
    row: int = Field(0, ge=0, description="Robots in a row, before the next one begins; 0: all in one row.")
    starts: tuple[StartPose, ...] = Field(
        (), description="Start poses robot by robot: [[loopback.starts]] tables; the rest stand in a row."
    )
    speed: Positive = Field(1.0, description="m/s")
    turn_rate: Positive = Field(2.0, description="rad/s")
    deceleration: float = Field(
        0.0, ge=0, allow_inf_nan=False, description="m/s² when told to stop; 0: it stops on the spot."
    )
    pose_interval: Positive = Field(0.2, description="Seconds between two poses while driving.")
    charge: float = Field(100.0, ge=0, le=100, description="State of charge at the start, percent.")
    drain: float = Field(1.0, ge=0, le=100, description="Percent of charge that 100 m of driving take.")
    charge_rate: Positive = Field(1.0, description="Percent of charge per second of charging.")
    control: bool = Field(
        default=False, description="Open the control door: commands by MQTT for what people and the world do."
    )
    rehearsal: bool = Field(
        default=False, description="Have the actions for rehearsal: some that fail, or need a parameter."
    )
    restarts: int = Field(
        5, ge=0, le=1000, description="How often a robot of a fleet is started again after a failure."
    )
    restart_pause: Positive = Field(
        1.0, description="Seconds before the first of these; each further pause is twice as long."
    )

    def start(self, index: int) -> StartPose:
        """Give where robot ``index``, from 0, stands at first."""
        if index < len(self.starts):
            return self.starts[index]
        row, column = divmod(index, self.row or self.count)
        return StartPose(x=self.x + column * self.spacing, y=self.y + row * self.spacing, theta=self.theta)
