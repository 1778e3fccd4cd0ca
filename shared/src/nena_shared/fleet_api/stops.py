"""Stops in the API: all robots, or those in an area, pause until a person ends the stop."""

from __future__ import annotations

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from nena_shared.fleet_api.base import Moment, ObjectName, Request, Resource
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.vda5050.topics import RobotKey

Person = Annotated[str, Field(min_length=1, max_length=100)]
Words = Annotated[str, Field(min_length=1, max_length=500)]


class SetBy(Resource):
    """Who has locked a path or set the integration level of a vehicle, and when."""

    by: str
    since: Moment


class Area(Request):
    """A rectangle, m in the plant frame."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float
    map_id: ObjectName | None = None
    """None: on every map."""

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        if not (self.x_min < self.x_max and self.y_min < self.y_max):
            raise ValueError("xMin must be less than xMax, and yMin less than yMax")
        return self

    def contains(self, x: float, y: float) -> bool:
        """Return whether a position, m in the plant frame, is in the rectangle or on its border."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max

    # 0054: a robot that drives straight to a coordinate may pass through without a point inside
    def crosses(self, start: tuple[float, float], end: tuple[float, float]) -> bool:
        """Return whether a straight line touches the rectangle (Liang and Barsky's algorithm)."""
        enters, leaves = 0.0, 1.0
        for begin, delta, low, high in (
            (start[0], end[0] - start[0], self.x_min, self.x_max),
            (start[1], end[1] - start[1], self.y_min, self.y_max),
        ):
            if delta == 0:
                if not low <= begin <= high:
                    return False
                continue
            first, last = sorted(((low - begin) / delta, (high - begin) / delta))
            enters, leaves = max(enters, first), min(leaves, last)
        return enters <= leaves


class StopRequest(Request):
    """Request to pause all robots, or those in an area."""

    by: Person | None = None
    """Name of the person; None: the user of the request's token."""
    reason: Words
    area: Area | None = None
    """Robots in it pause, and no others are let in; None: all robots pause."""


class StopEndRequest(Request):
    """Request to end a stop."""

    by: Person | None = None
    """Name of the person; None: the user of the request's token."""
    reason: Words = "no reason given"


class UnpausedVehicle(Resource):
    """A vehicle that a stop should pause, but whose robot does not report that it is paused."""

    vehicle: str
    reason: str
    """Reason, as text."""
    coded_reason: OptionalReason = None


class StopStatus(Resource):
    """A stop: all robots, or those in an area, are paused until a person ends it."""

    name: str
    by: str
    reason: str
    since: Moment
    area: Area | None = None
    """None: all robots."""
    vehicles: int = 0
    """Number of vehicles that it pauses; those that have never connected are not counted."""
    paused: int = 0
    """Number of them that are paused."""
    not_paused: tuple[UnpausedVehicle, ...] = ()
    """The others."""
    ended: Moment | None = None
    """Set in the answer to the request that ends it."""


class DirectStop(Resource):
    """A stop of all robots that the status aggregator has begun without the order service; retained.

    The order service continues or records it when it is back, and clears it. Versions of several writers are
    merged: an end is final.
    """

    name: str
    by: str
    reason: str
    since: Moment
    user: str
    """User of the token, for the audit trail."""
    paused: frozenset[RobotKey] = frozenset()
    """Robots that it has paused, and that continue at its end."""
    ended: Moment | None = None
    ended_by: str = ""
    end_reason: str = ""
    ended_by_user: str = ""

    def merged_with(self, other: DirectStop) -> DirectStop:
        """Return this version with what only the other one knows."""
        base = other if other.ended and not self.ended else self
        return base.model_copy(update={"paused": self.paused | other.paused})


DIRECT_ACTION: Final = "nena-stop-"
"""Beginning of the IDs of instant actions that the status aggregator sends."""


class StopList(Resource):
    """All active stops, the oldest first."""

    stops: tuple[StopStatus, ...]


class VehicleStop(Resource):
    """The stop that pauses a vehicle."""

    name: str
    by: str
    reason: str
    area: bool
    """Whether it is the stop of an area; false: of all robots."""
