"""Transport orders in the API: orders, sequences, failure policies, assignment, delivery."""

from __future__ import annotations

import json
from enum import StrEnum
from math import pi
from typing import Annotated, Self

from pydantic import AfterValidator, Field, StrictBool, model_validator

from nena_shared.fleet_api.base import (
    IdempotencyKey,
    Moment,
    ObjectName,
    OrderName,
    Request,
    Resource,
    Traceparent,
)
from nena_shared.fleet_api.peripherals import StepOperation
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.fleet_api.vehicle import ANY_TYPE, OrderType


class FailureMeasure(StrEnum):
    """A measure after a failure."""

    RETRY = "RETRY"
    """The same vehicle retries the same destination from its position."""
    REPLAN = "REPLAN"
    """The same vehicle takes another route that avoids the position of the failure."""
    OTHER_VEHICLE = "OTHER_VEHICLE"
    """The order waits for another vehicle; not applicable while the vehicle carries its load."""
    SKIP = "SKIP"
    """The operation is skipped, and the order continues with the next destination."""
    HOLD = "HOLD"
    """The order keeps its vehicle and waits until a person resumes or withdraws it."""
    FAIL = "FAIL"

    @property
    def last(self) -> bool:
        """Whether no other measure can follow."""
        return self in (FailureMeasure.HOLD, FailureMeasure.FAIL)


ONCE = (FailureMeasure.SKIP, FailureMeasure.HOLD, FailureMeasure.FAIL)


class FailureStep(Request):
    """A measure, the number of times to apply it, and its delay after the failure, s."""

    do: FailureMeasure
    times: Annotated[int, Field(ge=1, le=100)] = 1
    after: Annotated[float, Field(ge=0, le=86_400)] = 0.0
    """Only for RETRY and REPLAN."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.times > 1 and self.do in ONCE:
            raise ValueError(f"{self.do} is done once: omit times")
        if self.after and self.do not in (FailureMeasure.RETRY, FailureMeasure.REPLAN):
            raise ValueError(f"{self.do} does not wait: omit after")
        return self


def _ends_once(steps: tuple[FailureStep, ...]) -> tuple[FailureStep, ...]:
    if any(step.do.last for step in steps[:-1]):
        raise ValueError("HOLD and FAIL must be last")
    return steps


FailurePolicy = Annotated[tuple[FailureStep, ...], Field(max_length=20), AfterValidator(_ends_once)]
"""Steps tried in turn; steps that do not apply to a failure are skipped. Ends with FAIL implicitly."""

Seconds = Annotated[float, Field(gt=0, le=31_536_000)]
Priority = Annotated[int, Field(ge=-1000, le=1000)]


class Hold(Resource):
    """The hold of an order, which lasts until the order is resumed."""

    by: str
    """Name of the host or person; ``failure policy`` for the order service itself."""
    reason: str
    coded_reason: OptionalReason = None
    since: Moment


class TransportOrderState(StrEnum):
    """State of a transport order, with openTCS's names."""

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
        """Whether the order has ended."""
        return self in (
            TransportOrderState.FINISHED,
            TransportOrderState.FAILED,
            TransportOrderState.UNROUTABLE,
        )


class OrderOutcome(StrEnum):
    """How a transport order ended: withdrawals are apart from failures, while openTCS calls both FAILED."""

    FINISHED = "FINISHED"
    FAILED = "FAILED"
    """A robot, a device, a timeout or a dependency failed it."""
    UNROUTABLE = "UNROUTABLE"
    WITHDRAWN = "WITHDRAWN"
    """A person or host withdrew it."""
    GAVE_WAY = "GAVE_WAY"
    """The order service dropped it because its vehicle was needed for another order, and nothing failed."""

    @property
    def failure(self) -> bool:
        """Whether the order was not executed although it was wanted."""
        return self in (OrderOutcome.FAILED, OrderOutcome.UNROUTABLE)


class DependencyFailure(StrEnum):
    """Effect on an order if one of its dependencies ends in another state than FINISHED."""

    FAIL = "FAIL"
    """The order fails, too."""
    HOLD = "HOLD"
    """The order is held until it is resumed or withdrawn."""
    IGNORE = "IGNORE"
    """The order continues as if the dependency were FINISHED."""


class DriveOrderState(StrEnum):
    """State of a destination of a transport order."""

    PRISTINE = "PRISTINE"
    TRAVELLING = "TRAVELLING"
    OPERATING = "OPERATING"
    FINISHED = "FINISHED"
    FAILED = "FAILED"


Text = Annotated[str, Field(max_length=2000)]
# up to 2**53: readers in other languages may read JSON numbers as floats
Whole = Annotated[int, Field(strict=True, ge=-(2**53), le=2**53)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]


class OperationProperty(Request):
    """A key and value that becomes a parameter of the robot's action at a destination."""

    key: Annotated[str, Field(min_length=1, max_length=200)]
    value: Text | StrictBool | Whole | Number

    @property
    def text(self) -> str:
        """The value as text; numbers and booleans as in JSON."""
        return self.value if isinstance(self.value, str) else json.dumps(self.value)


class Property(OperationProperty):
    """A free-form key and value."""

    value: Text


class Coordinate(Request):
    """A position, m and rad in the plant frame; ``theta`` None: any heading."""

    x: float
    y: float
    theta: Annotated[float, Field(ge=-pi, le=pi)] | None = None


class Destination(Request):
    """A destination of a transport order: location or point by name, or coordinate; and its operation."""

    location_name: ObjectName | None = None
    """A location, or a point (then the operation is MOVE or PARK)."""
    coordinate: Coordinate | None = None
    operation: Annotated[str, Field(min_length=1, max_length=200)] = "MOVE"
    """Unset at a location without MOVE: NOP, which only drives there."""
    properties: Annotated[tuple[OperationProperty, ...], Field(max_length=100)] = ()
    peripheral_operations: Annotated[tuple[StepOperation, ...], Field(max_length=20)] = ()
    """Operations of peripheral devices, such as a conveyor or a door, for this destination."""
    on_failure: FailurePolicy | None = None
    """Failure policy for this destination; None: that of the order."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if (self.location_name is None) == (self.coordinate is None):
            raise ValueError("set either locationName or coordinate")
        return self


class OrderTemplate(Request):
    """What several transport orders can have in common."""

    destinations: Annotated[tuple[Destination, ...], Field(min_length=1, max_length=100)]
    intended_vehicle: ObjectName | None = None
    type: OrderType = "-"
    """Order type; the order is only assigned to vehicles that accept it."""
    priority: Priority = 0
    """Higher is more urgent."""
    dispensable: bool = False
    """Whether the order may be dropped if its vehicle is needed for another one, like parking orders."""
    peripheral_reservation_token: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """Reservation token of its peripheral jobs; None: its vehicle's name."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()
    on_failure: FailurePolicy | None = None
    """Failure policy; None: the order service's default."""
    timeout: Seconds | None = None
    """Seconds from creation, after which an unfinished order is withdrawn and cancelled at the robot."""
    processing_timeout: Seconds | None = None
    """The same, from its first assignment to a vehicle."""


class TransportOrderRequest(OrderTemplate):
    """Request to create a transport order; same body over REST and MQTT."""

    name: OrderName | None = None
    """None: the order service generates one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """Repeating a key returns the order created by the first request instead of creating another."""
    deadline: Moment | None = None
    """Orders with earlier deadlines are served first; an order not finished by then is ``late``."""
    dependencies: Annotated[tuple[OrderName, ...], Field(max_length=100)] = ()
    """Names of orders that must be FINISHED first; until then, the order is ACTIVE."""
    # openTCS leaves such an order waiting, without a reason, until the failed one is swept
    on_dependency_failure: DependencyFailure = DependencyFailure.FAIL
    wrapping_sequence: OrderName | None = None
    """Name of the order sequence to which it is added."""
    # 0060: not compared when a request is repeated, as each attempt of a client is another span
    traceparent: Traceparent | None = None
    """Trace of the host (W3C Trace Context), to which the order's trace links."""


class DriveOrderStatus(Resource):
    """State of a destination."""

    destination: Destination
    state: DriveOrderState
    route: tuple[str, ...] | None = None
    """Names of the points on the route, starting with the vehicle's; None before the assignment."""
    attempts: int = 0
    """Number of retries; each is another VDA 5050 order."""
    measures_taken: int = 0
    """Progress in the failure policy."""
    avoided: tuple[str, ...] = ()
    """Names of paths and points that the route avoids because the vehicle failed there."""


class HistoryEntry(Resource):
    """An event in the life of an order, and its reason."""

    timestamp: Moment
    event_code: str
    """Event code, e.g. ``nena:orderCreated``; documented in the operator guide."""
    supplements: tuple[str, ...] = ()
    """Explanation, as text."""
    coded_reason: OptionalReason = None
    """The last supplement as a code, if it is a reason."""


class TransportOrderStatus(Resource):
    """State of a transport order."""

    name: str
    version: int
    """Counts the changes; 1 initially."""
    state: TransportOrderState
    reason: str
    """Reason for the state, or what the order waits for, as text."""
    coded_reason: OptionalReason = None
    """The reason as a code; None: the order was last changed by a version without codes."""
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
    """Whether the deadline passed before the order ended."""
    dispensable: bool = False
    automatic: bool = False
    """Whether the order service created the order, to park or recharge a vehicle."""
    peripheral_reservation_token: str | None = None
    dependencies: tuple[str, ...] = ()
    on_dependency_failure: DependencyFailure = DependencyFailure.FAIL
    wrapping_sequence: str | None = None
    created: Moment
    created_by: str | None = None
    """User, host or schedule that created it; None: unknown, or the order service itself."""
    finished: Moment | None = None
    outcome: OrderOutcome | None = None
    """How it ended; None: it has not ended, or ended in a version without outcomes."""
    on_failure: FailurePolicy | None = None
    timeout: float | None = None
    processing_timeout: float | None = None
    assigned: Moment | None = None
    """Time of the first assignment to a vehicle."""
    held: Hold | None = None
    """The hold; None: not held."""
    next_try: Moment | None = None
    """Time of the next retry after a failure; None: no retry pending."""
    traceparent: str | None = None
    """Trace of the host, as requested."""
    excluded_vehicles: tuple[str, ...] = ()
    """Vehicles that failed the order, to which it is not assigned again."""
    history: tuple[HistoryEntry, ...] = ()

    @property
    def ended_as(self) -> OrderOutcome | None:
        """How it ended, by its state if it ended in a version without outcomes; None: it has not ended."""
        return self.outcome or (OrderOutcome(self.state) if self.state.final else None)


class Problem(Resource):
    """Problem details of a failed request (RFC 9457), the same over REST and MQTT."""

    type: str = "about:blank"
    """Kind of problem: a path of the order service with its description, or ``about:blank``."""
    title: str
    status: int
    detail: str
    """Reason, and what to do."""
    errors: tuple[str, ...] = ()


class CreationAnswer(Resource):
    """Answer to one request to create a transport order, over MQTT or in a batch."""

    status: int
    """HTTP status: 201 created, 200 already created with this key, 4xx rejected, 5xx failed."""
    name: str | None = None
    """Name in the request, or of the created order."""
    idempotency_key: str | None = None
    transport_order: TransportOrderStatus | None = None
    problem: Problem | None = None


class TransportOrderBatch(Request):
    """Request to create several transport orders."""

    transport_orders: Annotated[tuple[TransportOrderRequest, ...], Field(min_length=1, max_length=1000)]
    """Created one after the other: an order may depend on earlier ones."""
    check_only: bool = False
    """Whether nothing is created, to see what would be refused."""


class TransportOrderBatchAnswer(Resource):
    """The result of each order of a batch."""

    results: tuple[CreationAnswer, ...]
    """In the order of the requests; status 200 without an order: it could be created."""


class OrderSequenceRequest(Request):
    """Request to create an empty order sequence; orders join it with ``wrappingSequence``."""

    name: OrderName | None = None
    """None: the order service generates one."""
    incomplete_name: bool = False
    """Whether the order service completes ``name`` to a unique one."""
    idempotency_key: IdempotencyKey | None = None
    """Repeating a key returns the sequence created by the first request instead of creating another."""
    order_types: Annotated[tuple[OrderType, ...], Field(min_length=1, max_length=100)] = (ANY_TYPE,)
    """Types of orders that may be added; ``*``: any."""
    intended_vehicle: ObjectName | None = None
    failure_fatal: bool = False
    """Whether the failure of an order that is not dispensable fails all orders after it."""
    properties: Annotated[tuple[Property, ...], Field(max_length=100)] = ()


class OrderSequenceStatus(Resource):
    """State of an order sequence."""

    name: str
    version: int
    """Counts the changes; 1 initially."""
    reason: str
    """What the sequence waits for, or how it ended, as text."""
    order_types: tuple[str, ...]
    orders: tuple[str, ...] = ()
    """Names of its transport orders, in the order of execution."""
    finished_index: int = -1
    """Index of the last order up to which all have ended; -1: none."""
    complete: bool = False
    """Whether no more orders can be added."""
    finished: bool = False
    """Whether it is complete and all of its orders have ended, so that its vehicle is free."""
    failure_fatal: bool = False
    intended_vehicle: str | None = None
    processing_vehicle: str | None = None
    """Vehicle of the first order; reserved until the sequence is finished."""
    properties: tuple[Property, ...] = ()
    created: Moment
    finished_time: Moment | None = None
    history: tuple[HistoryEntry, ...] = ()


class VehicleForOrder(Resource):
    """Whether a vehicle can execute an order."""

    vehicle: str
    fits: bool
    """Whether it executes the order, or could do so now."""
    reason: str
    """Reason why not, as a phrase that follows the vehicle's name."""
    coded_reason: OptionalReason = None
    cost: float | None = None
    """Cost of the route, if feasible, in the unit of ``routing.costs`` (default: mm)."""


class AssignmentStatus(Resource):
    """Current assignment of a transport order, and vehicles that could execute it."""

    transport_order: str
    state: TransportOrderState
    reason: str
    """Reason for the state, or what the order waits for."""
    coded_reason: OptionalReason = None
    processing_vehicle: str | None = None
    vehicles: tuple[VehicleForOrder, ...] = ()
    """Vehicles: feasible ones first, by route cost; empty for an ended order."""
    left_out: int = 0
    """Number of vehicles not listed."""


class DeliveryPhase(StrEnum):
    """Delivery state of the VDA 5050 order of a transport order."""

    NONE = "NONE"
    """No VDA 5050 order: the transport order is not assigned, or has ended."""
    WAITING = "WAITING"
    """Not sent yet, because the robot is unreachable."""
    SENT = "SENT"
    """Sent, and resent until a state of the robot echoes it."""
    DELIVERED = "DELIVERED"
    """Accepted by the robot."""
    CANCELLING = "CANCELLING"
    """Being cancelled; not confirmed by the robot yet."""


class DeliveryStatus(Resource):
    """The delivery of a transport order to its robot."""

    transport_order: str
    phase: DeliveryPhase
    vehicle: str | None = None
    order_id: str | None = None
    """VDA 5050 orderId."""
    echoed_update_id: int | None = None
    """orderUpdateId in the robot's last state; None: the state does not contain this order."""
    note: str = ""
    """What it waits for, as text; empty if only for the robot to drive."""
