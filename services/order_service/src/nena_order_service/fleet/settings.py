"""Settings of the fleet-control side."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal

from pydantic import Field

from nena_shared.settings import SettingsGroup


class ReleasePolicy(StrEnum):
    """Who is let into a zone that needs a release."""

    EXCLUSIVE = "exclusive"
    """One robot at a time, in the order of asking."""
    ALL = "all"
    """Everybody."""
    NONE = "none"
    """Nobody: all are refused."""


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
    clear_instant_actions_from: int = Field(
        20, ge=1, description="Ended instant actions in a robot's state from which it is told to clear them."
    )
    release_policy: ReleasePolicy = Field(
        ReleasePolicy.EXCLUSIVE,
        description="Who is let into zones and corridors that need it: one robot at a time (exclusive), "
        "everybody (all) or nobody (none).",
    )
    release_lease: float = Field(
        0.0, ge=0, description="Seconds that such a release lasts unless it is renewed; 0: until given back."
    )
    qos: Literal[0, 1] = Field(
        1,
        description="MQTT quality of service of what is sent to robots and read of them; the standard has 0, "
        "except for connection.",
    )
    strict: bool = Field(
        default=False,
        description="Whether messages of robots that break the standard are refused rather than repaired, "
        "for acceptance tests of robots.",
    )
    robots_limit: int = Field(
        10_000, ge=1, description="Robots that are listened to; messages of further ones are passed over."
    )
    tick_interval: float = Field(0.2, gt=0, le=5, description="Seconds between looks at what is overdue.")
