"""Transport orders as hosts see them: orders, sequences, failure policies, assignment, delivery."""

from __future__ import annotations

import json
from enum import StrEnum
from math import pi
from typing import Annotated, Self

from pydantic import AfterValidator, Field, StrictBool, model_validator

from nena_shared.fleet_api.base import IdempotencyKey, Moment, ObjectName, OrderName, Request, Resource
from nena_shared.fleet_api.vehicle import ANY_TYPE, OrderType


class FailureMeasure(StrEnum):
    """One thing that can be done about a failure."""

    RETRY = "RETRY"
    """The same vehicle retries the same destination from its position."""
    REPLAN = "REPLAN"
    """The same vehicle takes another route, which avoids the position of the failure."""
    OTHER_VEHICLE = "OTHER_VEHICLE"
    """The order waits for another vehicle; never while the vehicle carries something for it."""
    SKIP = "SKIP"
    """The operation is skipped, and the order continues with the next destination."""
    HOLD = "HOLD"
    """The order keeps its vehicle and waits until a person resumes or withdraws it."""
    FAIL = "FAIL"

    @property
    def last(self) -> bool:
        """Return whether no other measure can follow it."""
        return self in (FailureMeasure.HOLD, FailureMeasure.FAIL)


ONCE = (FailureMeasure.SKIP, FailureMeasure.HOLD, FailureMeasure.FAIL)


class FailureStep(Request):
    """A measure, the number of times to take it, and its delay after the failure in seconds."""

    do: FailureMeasure
    times: Annotated[int, Field(ge=1, le=100)] = 1
    after: Annotated[float, Field(ge=0, le=86_400)] = 0.0
    """Only of RETRY and REPLAN."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.times > 1 and self.do in ONCE:
            message = f"{self.do} is done once: omit times"
            raise ValueError(message)
        if self.after and self.do not in (FailureMeasure.RETRY, FailureMeasure.REPLAN):
            message = f"{self.do} does not wait: omit after"
            raise ValueError(message)
        return self


def _ends_once(steps: tuple[FailureStep, ...]) -> tuple[FailureStep, ...]:
    if any(step.do.last for step in steps[:-1]):
        message = "HOLD and FAIL must be last"
        raise ValueError(message)
    return steps


FailurePolicy = Annotated[tuple[FailureStep, ...], Field(max_length=20), AfterValidator(_ends_once)]
"""Steps that are tried in turn; one that does not apply to a failure is skipped, and FAIL is the last one."""

Seconds = Annotated[float, Field(gt=0, le=31_536_000)]


class Hold(Resource):
    """An order that waits until a person resumes it."""

    by: str
    """The holder: a host or a person by name; ``failure policy`` for the order service itself."""
    reason: str
    since: Moment


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
        """Return whether the order has ended."""
        return self in (
            TransportOrderState.FINISHED,
            TransportOrderState.FAILED,
            TransportOrderState.UNROUTABLE,
        )


class DependencyFailure(StrEnum):
    """What happens to an order when one that it depends on does not end as FINISHED."""

    FAIL = "FAIL"
    """It fails, too."""
    HOLD = "HOLD"
    """It waits until a person resumes or withdraws it."""
    IGNORE = "IGNORE"
    """It continues as if the other one were FINISHED."""


class DriveOrderState(StrEnum):
    """State of one destination of a transport order."""

    PRISTINE = "PRISTINE"
    TRAVELLING = "TRAVELLING"
    OPERATING = "OPERATING"
    FINISHED = "FINISHED"
    FAILED = "FAILED"


Text = Annotated[str, Field(max_length=2000)]
Whole = Annotated[int, Field(strict=True, ge=-(2**53), le=2**53)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class OperationProperty(Request):
    """A key and value for the operation at a destination; it becomes a parameter of the robot's action."""

    key: Annotated[str, Field(min_length=1, max_length=200)]
    value: Text | StrictBool | Whole | Number

    @property
    def text(self) -> str:
        """The value as text; numbers and booleans as JSON has them."""
        return self.value if isinstance(self.value, str) else json.dumps(self.value)


class Property(OperationProperty):
    """A free key and value."""

    value: Text


class Coordinate(Request):
    """A position off the points: m and rad in the plant's frame; ``theta`` None: any heading."""

    x: float
    y: float
    theta: Annotated[float, Field(ge=-pi, le=pi)] | None = None


class Destination(Request):
    """One stop of a transport order: a location or point by name, or a coordinate; and what to do there."""

    location_name: ObjectName | None = None
    """A location, or a point (then the operation is MOVE or PARK)."""
    coordinate: Coordinate | None = None
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "MOVE"
    properties: Annotated[tuple[OperationProperty, ...], Field(max_length=100)] = ()
    on_failure: FailurePolicy | None = None
    """Measures if the vehicle fails here; None: those of the order."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.location_name is None) == (self.coordinate is None):
            message = "set either locationName or coordinate"
            raise ValueError(message)
        return self


class TransportOrderRequest(Request):
    """Request for a transport order; the same body over REST and over MQTT."""

    name: OrderName | None = None
    """None: the order service makes one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """A repeated key returns the order that the first request created, and creates no second one."""
    destinations: Annotated[tuple[Destination, ...], Field(min_length=1, max_length=100)]
    intended_vehicle: ObjectName | None = None
    type: OrderType = "-"
    """Order type; only vehicles that accept it get the order."""
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """Greater is more urgent."""
    deadline: Moment | None = None
    """Orders that are due earlier are served first; one that is not finished by then is ``late``."""
    dispensable: bool = False
    """Whether it may be dropped when its vehicle is needed for another order, like parking."""
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Kept and shown, as openTCS has it; there are no peripherals that it could reserve."""
    dependencies: Annotated[tuple[OrderName, ...], Field(max_length=100)] = ()
    """Names of orders that must be FINISHED first; until then it is ACTIVE."""
    on_dependency_failure: DependencyFailure = DependencyFailure.FAIL
    wrapping_sequence: OrderName | None = None
    """Name of the order sequence to which it is added."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()
    on_failure: FailurePolicy | None = None
    """Measures if the vehicle fails; None: those of the order service's setting."""
    timeout: Seconds | None = None
    """Seconds from its creation on; if it is not done by then, it is withdrawn and cancelled at the robot."""
    processing_timeout: Seconds | None = None
    """The same, from when it was first given to a vehicle."""


class DriveOrderStatus(Resource):
    """State of one destination."""

    destination: Destination
    state: DriveOrderState
    route: tuple[str, ...] | None = None
    """Names of the points to pass, the first is where the vehicle starts; None before the assignment."""
    attempts: int = 0
    """Number of repetitions; each is another VDA 5050 order."""
    measures_taken: int = 0
    """How far its failure policy is used up."""
    avoided: tuple[str, ...] = ()
    """Names of paths and points that its route avoids, because the vehicle failed there."""


class HistoryEntry(Resource):
    """Something that happened to an order, and why."""

    timestamp: Moment
    event_code: str
    """E.g. ``nena:orderCreated``; documented in the operator guide."""
    supplements: tuple[str, ...] = ()
    """In words."""


class TransportOrderStatus(Resource):
    """State of a transport order."""

    name: str
    version: int
    """Counts the changes; 1 initially."""
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
    """Whether the order service created it itself, to park a vehicle or to recharge it."""
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
    """The hold: by whom and why; None: not held."""
    next_try: Moment | None = None
    """When it is retried after a failure; None: nothing is waited for."""
    excluded_vehicles: tuple[str, ...] = ()
    """Vehicles that have failed at it, so that it is not given to them again."""
    history: tuple[HistoryEntry, ...] = ()


class Problem(Resource):
    """Why a request failed (RFC 9457), the same over REST and over MQTT."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    """The reason, and what to do."""
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


class OrderSequenceRequest(Request):
    """Request for an order sequence, initially empty; orders name it as their ``wrappingSequence``."""

    name: OrderName | None = None
    """None: the order service makes one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """A repeated key returns the sequence that the first request created, and creates no second one."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] = (ANY_TYPE,)
    """Types of the orders that may be added; ``*``: any."""
    intended_vehicle: ObjectName | None = None
    failure_fatal: bool = False
    """Whether all orders behind one that fails, and is not dispensable, fail with it."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()


class OrderSequenceStatus(Resource):
    """State of an order sequence."""

    name: str
    version: int
    """Counts the changes; 1 initially."""
    reason: str
    """What it waits for, or how it has ended, in words."""
    order_types: tuple[str, ...]
    orders: tuple[str, ...] = ()
    """Names of its transport orders, in the order in which they are done."""
    finished_index: int = -1
    """Index of the last order up to which all are at their end; -1 before the first."""
    complete: bool = False
    """Whether no more orders are added."""
    finished: bool = False
    """Whether it is complete and all of its orders are at their end: its vehicle is free."""
    failure_fatal: bool = False
    intended_vehicle: str | None = None
    processing_vehicle: str | None = None
    """The vehicle that took the first order; it is bound until the sequence is finished."""
    properties: tuple[Property, ...] = ()
    created: Moment
    finished_time: Moment | None = None
    history: tuple[HistoryEntry, ...] = ()


class VehicleForOrder(Resource):
    """What is between an order and one vehicle."""

    vehicle: str
    fits: bool
    """Whether it does the order, or could do it now."""
    reason: str
    """Why not, in words that follow its name."""
    cost: float | None = None
    """Cost of its route, if feasible; the unit is that of ``routing.costs``, mm by default."""


class AssignmentStatus(Resource):
    """How the dispatcher sees one transport order now."""

    transport_order: str
    state: TransportOrderState
    reason: str
    """Why it is in this state, or what it waits for."""
    processing_vehicle: str | None = None
    vehicles: tuple[VehicleForOrder, ...] = ()
    """The vehicles that could execute it first, the cheapest route before others; none for an ended order."""
    left_out: int = 0
    """How many vehicles more there are."""


class DeliveryPhase(StrEnum):
    """Where the VDA 5050 order of a transport order is."""

    NONE = "NONE"
    """There is none: no vehicle has the transport order, or it is at its end."""
    WAITING = "WAITING"
    """It is not sent: the robot cannot be sent anything now."""
    SENT = "SENT"
    """It is sent, and resent, until a state of the robot echoes it."""
    DELIVERED = "DELIVERED"
    """The robot has it."""
    CANCELLING = "CANCELLING"
    """It is to end early, and the robot has not confirmed that yet."""


class DeliveryStatus(Resource):
    """The delivery of one transport order."""

    transport_order: str
    phase: DeliveryPhase
    vehicle: str | None = None
    order_id: str | None = None
    """orderId of VDA 5050."""
    echoed_update_id: int | None = None
    """orderUpdateId that the robot's last state echoes; None: it echoes none of this order."""
    note: str = ""
    """What it waits for, in words; empty if it waits for nothing but the robot's driving."""
