"""Rerouting: another way for the order that a vehicle works on (openTCS: rerouting)."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Resource


class ReroutingType(StrEnum):
    """Where the new way begins."""

    REGULAR = "REGULAR"
    """At the end of what the robot was told to drive: it goes on without a stop, by an order update."""
    FORCED = "FORCED"
    """Where the robot stands: its order is cancelled first, and it gets a new one."""


class ReroutingOutcome(StrEnum):
    """What has become of a request for rerouting."""

    REROUTED = "REROUTED"
    """The vehicle goes another way."""
    UNCHANGED = "UNCHANGED"
    """The way stays; the reason says why."""
    STOPPING = "STOPPING"
    """The robot is told to stop, at once or at the end of its base; the way goes on from there."""


class ReroutingAnswer(Resource):
    """Answer to a request for rerouting."""

    vehicle: str
    transport_order: str
    outcome: ReroutingOutcome
    reason: str
    """In words."""
    route: tuple[str, ...] = ()
    """The points from the end of the base to the destination, where the way is known."""
