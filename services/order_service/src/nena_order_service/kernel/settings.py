"""Settings of the kernel."""

from __future__ import annotations

from pydantic import Field

from nena_order_service.dispatching.settings import DispatchSettings
from nena_shared.settings import SettingsGroup


class KernelSettings(SettingsGroup):
    """How orders and vehicles are handled."""

    adopt_unknown: bool = Field(
        default=False,
        description="Whether robots that are heard of, but not in the plant model, get orders too.",
    )
    default_map_id: str = Field(
        "", description="Map of robots whose plant model names none; empty: the map that the robot reports."
    )
    release_ahead: int = Field(
        0,
        ge=0,
        le=1000,
        description="Nodes that a robot is given ahead of it (preventive: without its link it stops after so "
        "many), the rest is shown as horizon; 0: its whole way at once (assertive).",
    )
    restart_patience: float = Field(
        20.0,
        ge=0,
        description="Seconds after the start in which robots are waited for that were there before; later "
        "the others drive on, and those keep what they held.",
    )
    traffic: bool = Field(
        default=True,
        description="Whether points, paths and blocks are given to one robot at a time; false: robots are "
        "sent wherever they are to go, and have to avoid each other by themselves.",
    )
    dispatch: DispatchSettings = Field(
        default_factory=DispatchSettings, description="Which order is given to which vehicle."
    )
    action_types: dict[str, str] = Field(
        default_factory=dict,
        description="VDA 5050 action types by the plant's operations, laid over the usual ones.",
    )
    commit_timeout: float = Field(
        10.0, gt=0, description="Seconds that a host waits at most for the store to take its request."
    )
    instant_action_timeout: float = Field(
        10.0, gt=0, description="Seconds that a caller waits at most for the end of an instant action."
    )
