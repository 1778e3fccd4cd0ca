"""Traffic control's plan in the API: when each vehicle will be where, and why it waits."""

from __future__ import annotations

from enum import StrEnum

from nena_shared.fleet_api.base import Moment, Resource
from nena_shared.fleet_api.reasons import OptionalReason


class WaitCause(StrEnum):
    """Reason why a vehicle waits for others."""

    PASSES = "PASSES"
    """The other vehicle holds the resource and is moving."""
    STANDS = "STANDS"
    """The other vehicle is stationary there."""
    GOES_FIRST = "GOES_FIRST"
    """The other vehicle goes first."""
    LOCKED = "LOCKED"
    """A lock of the path ``at`` leaves no route."""


class TrafficWait(Resource):
    """The vehicles that a vehicle waits for, where and why."""

    vehicles: tuple[str, ...] = ()
    """Empty: not waiting for another vehicle."""
    at: str | None = None
    """The contested point, path, location or block; without ``vehicles``, the locked path or the location of
    the peripheral device that is waited for; None: waiting for something else."""
    cause: WaitCause | None = None
    turn_back: float | None = None
    """Distance that the other vehicle would have to go back if this one went first, m."""
    reason: str
    """Explanation, as in the reason of its order."""
    coded_reason: OptionalReason = None


class PlannedPoint(Resource):
    """A point on the planned route of a vehicle."""

    point: str
    path: str | None = None
    """Path to the point; None: straight line."""
    held: bool
    """Whether the vehicle may drive there; false: only planned."""
    seconds: float | None = None
    """Time until the expected arrival, s; None: beyond the horizon, or unknown."""


class VehiclePlan(Resource):
    """Position, resources, route and wait of a vehicle."""

    vehicle: str
    transport_order: str | None = None
    at: str
    """Last reached point."""
    holds: tuple[str, ...]
    """Points, paths, locations and blocks reserved for this vehicle."""
    ahead: tuple[PlannedPoint, ...] = ()
    """Points of the route within the horizon."""
    goal: str | None = None
    """End of the route; None: no route."""
    wait: TrafficWait | None = None
    """None: not waiting."""


class TrafficPlan(Resource):
    """The plan for the next minute, with all vehicles that hold resources."""

    time: Moment
    horizon: float
    """Length of the plan, seconds."""
    vehicles: tuple[VehiclePlan, ...]
