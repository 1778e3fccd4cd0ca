"""Settings of the ready-made actions."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from nena_edge_agent.protocol.declaration import ALL_BLOCKING_TYPES
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope


class OperationSettings(SettingsGroup):
    """An action that takes a set time: for demonstrations, and for stations that do the work themselves."""

    action_type: str = Field(min_length=1, max_length=100, description="Its name in orders.")
    seconds: float = Field(5.0, ge=0, le=86_400, allow_inf_nan=False, description="How long it takes.")
    load: Literal["take", "give", ""] = Field(
        "", description="take: loads the robot, which must be empty; give: unloads it, which must be loaded."
    )
    charging: bool | None = Field(None, description="Whether the robot charges afterwards; unset: as before.")
    scopes: tuple[ActionScope, ...] = Field(
        (ActionScope.NODE,), description="Where it may stand: NODE, EDGE, INSTANT."
    )
    blocking_types: tuple[BlockingType, ...] = Field(
        ALL_BLOCKING_TYPES, description="Blocking types that orders may give it."
    )
    interruptible: bool = Field(default=True, description="Whether it can be paused and cancelled.")


def default_operations() -> tuple[OperationSettings, ...]:
    """Give what a robot can do that was told of nothing else."""
    on_request = (ActionScope.NODE, ActionScope.INSTANT)
    return (
        OperationSettings(action_type="pick", seconds=5.0, load="take"),
        OperationSettings(action_type="drop", seconds=5.0, load="give"),
        OperationSettings(action_type="startCharging", seconds=1.0, charging=True, scopes=on_request),
        OperationSettings(action_type="stopCharging", seconds=1.0, charging=False, scopes=on_request),
    )
