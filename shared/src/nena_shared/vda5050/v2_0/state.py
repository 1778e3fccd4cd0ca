"""The state message of 2.0 (section 6.10)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, PlainSerializer

from nena_shared.vda5050.base import Percent
from nena_shared.vda5050.v2_1.error import ErrorEntryV21
from nena_shared.vda5050.v2_1.state import PowerSupplyV21, StateV21
from nena_shared.vda5050.wire_names import Absent

WholePercent = Annotated[Percent, PlainSerializer(round, return_type=int, when_used="json")]


class ErrorEntryV20(ErrorEntryV21):
    """An error; 2.0 has no hints."""

    error_hint: Absent = None


class PowerSupplyV20(PowerSupplyV21):
    """The battery; its health is a whole number."""

    battery_health: WholePercent | None = None


class StateV20(StateV21):
    """Everything about the robot; 2.0 knows no maps."""

    maps: Absent = None
    errors: tuple[ErrorEntryV20, ...]
    power_supply: Annotated[PowerSupplyV20, Field(alias="batteryState")]
