"""The plan of traffic control for hosts: where each vehicle drives at which time, and why it waits."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Moment, Resource


class WaitCause(StrEnum):
    """Why a vehicle waits for others."""

    PASSES = "PASSES"
    """The other one holds the resource, and drives on."""
    STANDS = "STANDS"
    """The other vehicle is standing there."""
    GOES_FIRST = "GOES_FIRST"
    """The other one has to go first."""


class TrafficWait(Resource):
    """Which vehicles a vehicle waits for, where and why."""

    vehicles: tuple[str, ...] = ()
    """Empty: it does not wait for another vehicle."""
    at: str | None = None
    """The point, path, location or block that they need; None: it waits for something else."""
    cause: WaitCause | None = None
    turn_back: float | None = None
    """Distance that the other vehicle would have to turn back if this one went first, m."""
    reason: str
    """All of it in words, as in the reason of its order."""


class PlannedPoint(Resource):
    """A point on the planned route of a vehicle."""

    point: str
    path: str | None = None
    """The path to it; None: straight."""
    held: bool
    """Whether it may drive there; false: it is only planned."""
    seconds: float | None = None
    """From now until it is expected there; None: later than the horizon, or not known."""


class VehiclePlan(Resource):
    """What one vehicle occupies, holds, is to drive and waits for."""

    vehicle: str
    transport_order: str | None = None
    at: str
    """The point that it has reached last."""
    holds: tuple[str, ...]
    """Points, paths, locations and blocks that no other vehicle may use meanwhile."""
    ahead: tuple[PlannedPoint, ...] = ()
    """The points of its route, as far as it could drive within the horizon."""
    goal: str | None = None
    """The end of its route; None: it has no route."""
    wait: TrafficWait | None = None
    """None: nothing keeps it."""


class TrafficPlan(Resource):
    """The plan of the next minute, of all vehicles that hold resources."""

    time: Moment
    horizon: float
    """Seconds that the plan looks ahead."""
    vehicles: tuple[VehiclePlan, ...]
