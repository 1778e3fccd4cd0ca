"""Settings of the kinds of actions beyond a topic, a service and Nav2's servers."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, JsonValue, model_validator

from nena_edge_agent.actions.plugin import TopicQos
from nena_edge_agent.actions.settings import (
    AnswerSettings,
    CallSettings,
    CommandSettings,
    OperationBase,
    RosOperationSettings,
    Seconds,
    TypeName,
)
from nena_edge_agent.nav2.settings import RosName
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope

Metres = Annotated[float, Field(ge=-10, le=10, allow_inf_nan=False)]
Radians = Annotated[float, Field(ge=-3.15, le=3.15, allow_inf_nan=False)]


class SignalOperationSettings(RosOperationSettings):
    """Waits for a message."""

    kind: Literal["signal"]
    answer: AnswerSettings = Field(description="Message to wait for.")
    timeout: Seconds | None = Field(None, description="Timeout, seconds. Unset: none.")
    restartable: bool = Field(default=True, description="Continue waiting after a restart of the agent.")


BATTERY = AnswerSettings(
    topic="battery_state",
    type="sensor_msgs/msg/BatteryState",
    match={"power_supply_status": [1, 4]},
    qos=TopicQos.BEST_EFFORT,
)
"""Confirms that the battery is charging or full."""
BATTERY_NOT_CHARGING = BATTERY.model_copy(update={"match": {"power_supply_status": [0, 2, 3]}})


class ChargeOperationSettings(RosOperationSettings):
    """Starts or stops charging: by a message or a service if needed, until the battery reports it.

    VDA 5050 3.0 section 6.2.3.
    """

    kind: Literal["charge"]
    action_type: str = Field(
        "startCharging", min_length=1, max_length=100, description="Action type in orders."
    )
    charging: bool = Field(default=True, description="true: start charging; false: stop.")
    scopes: tuple[ActionScope, ...] = Field(
        (ActionScope.NODE, ActionScope.INSTANT), min_length=1, description="Scopes."
    )
    command: CommandSettings | None = Field(None, description="Message to publish first.")
    call: CallSettings | None = Field(None, description="Service to call first.")
    answer: AnswerSettings | None = Field(
        None, description="Message that confirms it. Unset: the battery state."
    )
    restartable: bool = Field(default=True, description="May be restarted.")

    @property
    def confirmation(self) -> AnswerSettings:
        """Return the settings of the answer that confirms the end."""
        # FINISHED once the robot charges or no longer does, not once it was told to (6.2.3; 2.1: 6.8).
        return self.answer or (BATTERY if self.charging else BATTERY_NOT_CHARGING)


class TurnSignalSettings(RosOperationSettings):
    """Sets a turn signal. If EDGE is the only scope, it is switched off at the end of the edge."""

    kind: Literal["turn_signal"]
    action_type: str = Field(
        "setTurnSignal", min_length=1, max_length=100, description="Action type in orders."
    )
    scopes: tuple[ActionScope, ...] = Field((ActionScope.EDGE,), min_length=1, description="Scopes.")
    blocking_types: tuple[BlockingType, ...] = Field(
        (BlockingType.NONE,), min_length=1, description="Allowed blocking types."
    )
    topic: RosName = Field("turn_signal", description="Topic of the signal.")
    type: TypeName = Field("std_msgs/msg/String", description="Message type.")
    field: str = Field("data", min_length=1, description="Message field with the direction.")
    values: dict[str, JsonValue] = Field(
        {"left": "left", "right": "right", "off": "off"},
        min_length=1,
        description="Field value for each direction in orders; one of them is off.",
    )
    timeout: None = Field(None, description="Unused: signals take no time.")
    restartable: bool = Field(default=True, description="Set again after a restart of the agent.")

    @model_validator(mode="after")
    def _has_off(self) -> Self:
        if "off" not in self.values:
            raise ValueError("values must contain 'off'")
        return self


class DockOperationSettings(OperationBase):
    """Drives from the robot's pose to a nearby pose, given in the robot's own frame."""

    kind: Literal["dock"]
    blocking_types: tuple[BlockingType, ...] = Field(
        (BlockingType.SOFT, BlockingType.HARD),
        min_length=1,
        description="SOFT or HARD: the order must not drive meanwhile.",
    )
    forward: Metres = Field(0.5, description="Distance forward, metres; negative: backward.")
    left: Metres = Field(0.0, description="Distance to the left, metres; negative: to the right.")
    turn: Radians = Field(0.0, description="Turn to the left at the end, radians.")
    adjustable: bool = Field(
        default=False, description="Orders may override the distance with the parameter 'forward'."
    )
    deviation_xy: float = Field(0.1, gt=0, le=1, description="Position tolerance at the end, metres.")
    deviation_theta: float = Field(0.1, gt=0, le=3.15, description="Heading tolerance at the end, radians.")
    speed: float | None = Field(None, gt=0, le=10, description="Maximum speed, m/s. Unset: the robot's.")
    timeout: Seconds = Field(60.0, description="Timeout, seconds.")

    @model_validator(mode="after")
    def _check_scope(self) -> Self:
        # Only SOFT and HARD forbid the order's own driving meanwhile (VDA 5050, 6.2.2; 2.1: 6.12).
        if self.scopes != (ActionScope.NODE,) or not {*self.blocking_types} <= {
            BlockingType.SOFT,
            BlockingType.HARD,
        }:
            raise ValueError("an action that drives needs the scope NODE and the blocking type SOFT or HARD")
        return self
