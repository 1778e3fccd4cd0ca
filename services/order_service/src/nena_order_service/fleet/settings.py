"""Settings of the fleet-control side."""

from __future__ import annotations

from pydantic import Field

from nena_shared.settings import SettingsGroup


class FleetSettings(SettingsGroup):
    """How patient fleet control is with robots; seconds throughout."""

    silent_after: float = Field(
        35.0,
        gt=0,
        description="Least age of a robot's last state, in seconds, from which it counts as silent.",
    )
    silent_intervals: float = Field(
        3.0,
        ge=0,
        description="A robot that names its usual state interval is silent only after so many of them.",
    )
    resend_after: float = Field(
        1.0, gt=0, description="Seconds before an unanswered message is sent again; doubled each time."
    )
    resend_at_most_after: float = Field(8.0, gt=0, description="Longest pause before sending again, seconds.")
    sendings: int = Field(6, ge=1, description="How often a message is sent before its delivery has failed.")
    standstill_patience: float = Field(
        10.0, ge=0, description="Seconds that a robot may stand with a fatal error before its order fails."
    )
    instant_action_limit: float = Field(
        300.0, gt=0, description="Seconds that an instant action, cancelOrder too, may take at a robot."
    )
    robots_limit: int = Field(
        10_000, ge=1, description="Robots that are listened to; messages of further ones are passed over."
    )
    tick_interval: float = Field(0.2, gt=0, le=5, description="Seconds between looks at what is overdue.")
