"""Transport orders: what a host asks for, and what it is told."""

from __future__ import annotations

from enum import StrEnum
from math import pi
from typing import Annotated, Self

from pydantic import Field, model_validator

from nena_shared.fleet_api.base import IdempotencyKey, Moment, ObjectName, OrderName, Request, Resource
from nena_shared.fleet_api.failure_policy import FailurePolicy, Hold, Seconds
from nena_shared.fleet_api.order_types import OrderType


class TransportOrderState(StrEnum):
    """Life cycle of a transport order, in openTCS's words."""

    RAW = "RAW"
    ACTIVE = "ACTIVE"
    DISPATCHABLE = "DISPATCHABLE"
    BEING_PROCESSED = "BEING_PROCESSED"
    WITHDRAWN = "WITHDRAWN"
    FINISHED = "FINISHED"
    FAILED = "FAILED"
    UNROUTABLE = "UNROUTABLE"

    @property
    def final(self) -> bool:
        """Whether nothing more comes of the order."""
        return self in (
            TransportOrderState.FINISHED,
            TransportOrderState.FAILED,
            TransportOrderState.UNROUTABLE,
        )


class DependencyFailure(StrEnum):
    """What becomes of an order when one that it depends on does not end as FINISHED."""

    FAIL = "FAIL"
    """It fails, too."""
    HOLD = "HOLD"
    """It waits until a person resumes or withdraws it."""
    IGNORE = "IGNORE"
    """It goes on as if the other one were FINISHED."""


class DriveOrderState(StrEnum):
    """Where one destination of a transport order stands."""

    PRISTINE = "PRISTINE"
    TRAVELLING = "TRAVELLING"
    OPERATING = "OPERATING"
    FINISHED = "FINISHED"
    FAILED = "FAILED"


class Property(Request):
    """A free key and value."""

    key: Annotated[str, Field(min_length=1, max_length=200)]
    value: Annotated[str, Field(max_length=2000)]


class Coordinate(Request):
    """A place off the points: m and rad in the plant's frame; ``theta`` None: any heading."""

    x: float
    y: float
    theta: Annotated[float, Field(ge=-pi, le=pi)] | None = None


class Destination(Request):
    """One stop of a transport order: a location or point by name, or a coordinate; and what to do there."""

    location_name: ObjectName | None = None
    """A location, or a point (then the operation is MOVE or PARK)."""
    coordinate: Coordinate | None = None
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "MOVE"
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()
    on_failure: FailurePolicy | None = None
    """What is done when the vehicle fails here; None: what the order says."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.location_name is None) == (self.coordinate is None):
            message = "give either locationName or coordinate"
            raise ValueError(message)
        return self


class TransportOrderRequest(Request):
    """Asks for a transport order; the same body over REST and over MQTT."""

    name: OrderName | None = None
    """None: the order service makes one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """The same key again gives the order that the first request made, and no second one."""
    destinations: Annotated[tuple[Destination, ...], Field(min_length=1, max_length=100)]
    intended_vehicle: ObjectName | None = None
    type: OrderType = "-"
    """Which vehicles take it: those that accept orders of this type."""
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """Greater is more urgent."""
    deadline: Moment | None = None
    """Orders that are due earlier come first; one that is not done by then is ``late``."""
    dispensable: bool = False
    """Whether it may be dropped when something better comes for its vehicle, as parking may."""
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Kept and shown, as openTCS has it; there are no peripherals that it could reserve."""
    dependencies: Annotated[tuple[OrderName, ...], Field(max_length=100)] = ()
    """Names of orders that must be FINISHED first; until then it is ACTIVE."""
    on_dependency_failure: DependencyFailure = DependencyFailure.FAIL
    wrapping_sequence: OrderName | None = None
    """Name of the order sequence to which it is added."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()
    on_failure: FailurePolicy | None = None
    """What is done when the vehicle fails; None: what the order service's setting says."""
    timeout: Seconds | None = None
    """Seconds from its creation on; if it is not done by then, it is withdrawn and cancelled at the robot."""
    processing_timeout: Seconds | None = None
    """The same, from when it was first given to a vehicle."""


class DriveOrderStatus(Resource):
    """Where one destination stands."""

    destination: Destination
    state: DriveOrderState
    route: tuple[str, ...] | None = None
    """Names of the points to pass, the first is where the vehicle starts; None before the assignment."""
    attempts: int = 0
    """How often it was begun again: each time is another VDA 5050 order."""
    measures_taken: int = 0
    """How far its failure policy is used up."""
    avoided: tuple[str, ...] = ()
    """Names of paths and points that its way avoids, since the vehicle failed there."""


class HistoryEntry(Resource):
    """Something that happened to an order, and why."""

    timestamp: Moment
    event_code: str
    """E.g. ``nena:orderCreated``; documented in the operator guide."""
    supplements: tuple[str, ...] = ()
    """In words."""


class TransportOrderStatus(Resource):
    """A transport order as it stands."""

    name: str
    version: int
    """Counts the changes; 1 at first."""
    state: TransportOrderState
    reason: str
    """Why it is in this state, or what it waits for, in words."""
    type: str
    priority: int
    intended_vehicle: str | None = None
    processing_vehicle: str | None = None
    drive_orders: tuple[DriveOrderStatus, ...]
    current_drive_order_index: int
    """-1 before the first."""
    properties: tuple[Property, ...] = ()
    deadline: Moment | None = None
    late: bool = False
    """Whether the deadline had passed before it was at its end."""
    dispensable: bool = False
    automatic: bool = False
    """Whether the order service has made it by itself, to park a vehicle or to recharge it."""
    peripheral_reservation_token: str | None = None
    dependencies: tuple[str, ...] = ()
    on_dependency_failure: DependencyFailure = DependencyFailure.FAIL
    wrapping_sequence: str | None = None
    created: Moment
    finished: Moment | None = None
    on_failure: FailurePolicy | None = None
    timeout: float | None = None
    processing_timeout: float | None = None
    assigned: Moment | None = None
    """When it was first given to a vehicle."""
    held: Hold | None = None
    """Who holds it and why; None: nobody."""
    next_try: Moment | None = None
    """When it is tried again after a failure; None: nothing is waited for."""
    excluded_vehicles: tuple[str, ...] = ()
    """Vehicles that have failed at it, so that it is not given to them again."""
    history: tuple[HistoryEntry, ...] = ()


class Problem(Resource):
    """What went wrong with a request (RFC 9457), over REST and over MQTT."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    """Says what to do."""
    errors: tuple[str, ...] = ()


class CreationAnswer(Resource):
    """Answer over MQTT to a request for a transport order."""

    status: int
    """As in HTTP: 201 made, 200 was there already under the same key, 4xx refused, 5xx failed."""
    name: str | None = None
    """Of the request or of the order made."""
    idempotency_key: str | None = None
    transport_order: TransportOrderStatus | None = None
    problem: Problem | None = None
