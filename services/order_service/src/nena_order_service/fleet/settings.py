"""Settings of the fleet-control side."""

from __future__ import annotations

from enum import StrEnum

from pydantic import Field

from nena_shared.settings import SettingsGroup


class ReleasePolicy(StrEnum):
    """Which robot is granted a zone that needs a release."""

    EXCLUSIVE = "exclusive"
    """One robot at a time, in the order of their requests."""
    ALL = "all"
    """All robots."""
    NONE = "none"
    """All requests are refused."""


class FleetSettings(SettingsGroup):
    """Timeouts and limits of fleet control; all times in seconds."""

    silent_after: float = Field(
        35.0,
        gt=0,
        description="Time without a state after which a robot is silent, seconds.",
    )
    silent_intervals: float = Field(
        3.0,
        ge=0,
        description="State intervals (by its factsheet) that a robot may miss before it is silent.",
    )
    resend_after: float = Field(
        1.0,
        gt=0,
        description="Delay before an unacknowledged message is sent again, seconds; doubles each time.",
    )
    resend_at_most_after: float = Field(8.0, gt=0, description="Maximum delay between resends, seconds.")
    sendings: int = Field(6, ge=1, description="Attempts to send a message before its delivery fails.")
    standstill_patience: float = Field(
        10.0, ge=0, description="Time a robot may stand with a fatal error before its order fails, seconds."
    )
    instant_action_limit: float = Field(
        300.0, gt=0, description="Timeout of instant actions, including cancelOrder, seconds."
    )
    clear_instant_actions_from: int = Field(
        20,
        ge=1,
        description="Number of ended instant actions in a state at which clearInstantActions is sent.",
    )
    release_policy: ReleasePolicy = Field(
        ReleasePolicy.EXCLUSIVE,
        description="Who may enter zones and corridors that need a release: one robot at a time "
        "(exclusive), every robot (all) or none.",
    )
    release_lease: float = Field(
        0.0, ge=0, description="Lease of a release, seconds. 0: until it is returned."
    )
    # no Literal: the command line and the environment give texts
    qos: int = Field(
        1,
        ge=0,
        le=1,
        description="MQTT QoS of messages to and from robots. The standard uses 0, except for connection.",
    )
    strict: bool = Field(
        default=False,
        description="Refuse robot messages that violate VDA 5050 instead of repairing them; for acceptance "
        "tests of robots.",
    )
    robots_limit: int = Field(
        10_000, ge=1, description="Maximum number of robots; messages of others are ignored."
    )
    messages_per_second: float = Field(
        200.0,
        gt=0,
        description="Sustained messages per second on each topic of a robot; every 10 kB count as one. "
        "Others are ignored.",
    )
    messages_burst: int = Field(2000, ge=1, description="Burst of messages on each topic of a robot.")
    tick_interval: float = Field(
        0.2, gt=0, le=5, description="Interval between checks for timeouts, seconds."
    )
