"""Request bodies and queries of hosts, and responses used by a single operation."""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from nena_shared.fleet_api.base import (
    IdempotencyKey,
    Moment,
    ObjectName,
    PageSize,
    Request,
    Resource,
    Traceparent,
)
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.fleet_api.stops import Person
from nena_shared.fleet_api.transport_order import (
    Coordinate,
    Destination,
    OrderSequenceStatus,
    Priority,
    Seconds,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import (
    AcceptableOrderType,
    IntegrationLevel,
    ProcessingState,
    ReroutingType,
    VehicleState,
    VehicleStatus,
)
from nena_shared.vda5050.action import ActionStatus, BlockingType, ParameterValue

# 18 digits fit into a 64-bit integer of the store
AfterNumber = Annotated[str, Field(pattern=r"^[0-9]{1,18}$")]
"""Value of ``next`` of the previous page."""

VEHICLES_EXPLAINED = 100
"""Default number of vehicles in an assignment response."""


class TransportOrdersQuery(Resource):
    """Filter and page of transport orders."""

    state: list[TransportOrderState] | None = None
    intended_vehicle: str | None = None
    since: Moment | None = None
    """Only orders created at this time or later."""
    until: Moment | None = None
    """Only orders created before this time."""
    limit: PageSize = 100
    after: AfterNumber | None = None


class OrderSequencesQuery(Resource):
    """Filter and page of order sequences."""

    finished: bool | None = None
    """None: finished and unfinished ones."""
    intended_vehicle: str | None = None
    since: Moment | None = None
    """Only sequences created at this time or later."""
    until: Moment | None = None
    """Only sequences created before this time."""
    limit: PageSize = 100
    after: AfterNumber | None = None


class VehiclesQuery(Resource):
    """Filter and page of vehicles."""

    state: list[VehicleState] | None = None
    processing_state: list[ProcessingState] | None = None
    limit: Annotated[int, Field(ge=1, le=10_000)] = 10_000
    after: ObjectName | None = None


class AssignmentQuery(Resource):
    """Number of vehicles in an assignment response."""

    limit: PageSize = VEHICLES_EXPLAINED


class TransportOrderPage(Resource):
    """A page of transport orders, newest first."""

    transport_orders: tuple[TransportOrderStatus, ...]
    next: str | None
    """Value of ``after`` for the next page; None: this is the last one."""


class OrderSequencePage(Resource):
    """A page of order sequences, newest first."""

    order_sequences: tuple[OrderSequenceStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""


class VehicleList(Resource):
    """A page of vehicles, those of the plant model first."""

    vehicles: tuple[VehicleStatus, ...]
    next: str | None = None
    """Value of ``after`` for the next page; None: this is the last one."""


class OrderChange(Request):
    """Changes of a transport order that waits for a vehicle; what is left out stays as it is."""

    priority: Priority = 0
    intended_vehicle: ObjectName | None = None
    """null: any vehicle."""
    deadline: Moment | None = None
    """null: none."""
    timeout: Seconds | None = None
    """Seconds from its creation; null: none."""

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if self.model_fields_set.isdisjoint(OrderChange.model_fields):
            raise ValueError("set at least one of priority, intendedVehicle, deadline and timeout")
        return self

    @property
    def changes(self) -> dict[str, Any]:
        """New values by the names of the fields that are given."""
        return {
            name: getattr(self, name) for name in OrderChange.model_fields if name in self.model_fields_set
        }


class WithdrawalRequest(Request):
    """Request to withdraw a transport order."""

    # 0112: a text of the table of reasons, so that the panel shows it in its user's language
    reason: Annotated[str, Field(min_length=1, max_length=500)] = "withdrawn by a host"
    immediate: bool = True
    """Whether its robot is to stop; false: it drives to the end of its base."""


SOMEBODY = "somebody"
"""Name of a requester without a name."""

BY_LIMIT = 100
"""Maximum length of the caller's name."""


class ResumeRequest(Request):
    """Request to resume a held transport order."""

    by: Annotated[str, Field(min_length=1, max_length=BY_LIMIT)] | None = None
    """The caller: a person or a program, by name; None: the user of the request's token."""
    reason: Annotated[str, Field(min_length=1, max_length=500)] = "no reason given"


class HoldRequest(ResumeRequest):
    """Request to hold a transport order until it is resumed."""

    immediate: bool = True
    """Whether its robot is to stop; false: it drives to the end of its base."""


class IntegrationLevelRequest(Request):
    """The new integration level of a vehicle."""

    integration_level: IntegrationLevel
    by: Person | None = None
    """Name of the person; None: the user of the request's token."""


class OrderTypesRequest(Request):
    """The order types that a vehicle accepts."""

    acceptable_order_types: Annotated[tuple[AcceptableOrderType, ...], Field(max_length=100)]
    """``*`` accepts any type; an empty list accepts no orders."""

    @model_validator(mode="after")
    def _each_once(self) -> Self:
        names = [order_type.name for order_type in self.acceptable_order_types]
        if len(names) != len(set(names)):
            raise ValueError("list each type once")
        return self


class ReroutingRequest(Request):
    """Request to reroute a vehicle's current order."""

    type: ReroutingType = ReroutingType.REGULAR
    """REGULAR: from the end of the robot's base; FORCED: from its position."""


class DispatchRequest(Request):
    """Request to send a vehicle to a point, location, or coordinate in the plant frame."""

    point: ObjectName | None = None
    location_name: ObjectName | None = None
    coordinate: Coordinate | None = None
    operation: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    """None: MOVE at a point or coordinate, NOP at a location."""
    priority: Priority = 0
    idempotency_key: IdempotencyKey | None = None
    traceparent: Traceparent | None = None
    """Trace of the host (W3C Trace Context), to which the order's trace links."""

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        if sum(place is not None for place in (self.point, self.location_name, self.coordinate)) != 1:
            raise ValueError("set exactly one of point, locationName and coordinate")
        return self

    def destination(self) -> Destination:
        """Return the destination of the resulting order."""
        operation = self.operation or ("NOP" if self.location_name else "MOVE")
        name = self.location_name or self.point
        return Destination(location_name=name, coordinate=self.coordinate, operation=operation)


class Parameter(Request):
    """A parameter of an action."""

    key: Annotated[str, Field(min_length=1, max_length=200)]
    value: ParameterValue


class InitialPose(Request):
    """Pose of a robot, m and rad in the plant frame."""

    x: float
    y: float
    theta: Annotated[float, Field(ge=-pi, le=pi)]
    map_id: ObjectName | None = None
    """None: the vehicle's current map."""


class InstantActionRequest(Request):
    """Request to send an instant action to a robot.

    ``pause`` and ``resume`` become startPause and stopPause. ``initializePosition`` requires a pose. Other
    types are sent unchanged with their parameters.
    """

    action_type: Annotated[str, Field(min_length=1, max_length=200)]
    pose: InitialPose | None = None
    parameters: Annotated[tuple[Parameter, ...], Field(max_length=100)] = ()
    blocking_type: BlockingType = BlockingType.NONE

    @model_validator(mode="after")
    def _pose_where_needed(self) -> Self:
        if (self.action_type == "initializePosition") != (self.pose is not None):
            raise ValueError("a pose is required for initializePosition and not allowed for other actions")
        return self


class InstantActionAnswer(Resource):
    """Result of an instant action."""

    action_id: str
    action_type: str
    status: ActionStatus | Literal["UNKNOWN", "PENDING"]
    """FINISHED or FAILED; PENDING: still running; UNKNOWN: the robot never reported it."""
    reason: str
    """Reason, as text."""
    coded_reason: OptionalReason = None
    result: str | None = None
    """Result reported by the robot."""


class FleetSummary(Resource):
    """Numbers of open orders and vehicles by state."""

    transport_orders: dict[TransportOrderState, int]
    """Number of unfinished orders by state."""
    vehicles: dict[VehicleState, int]
    """Number of vehicles by state."""
    oldest_order: str | None
    """Name of the oldest unfinished order; None: no order."""


class Readiness(Resource):
    """Whether the order service is ready, and what is missing."""

    ready: bool
    role: Literal["active", "standby", "starting"] = "active"
    """A standby waits for the active one to end; a starting one waits until its store is writable."""
    broker_connected: bool
    store_ready: bool
    loop_lag: float = 0.0
    """Longest delay of the event loop in the last minute, s."""
    problems: tuple[str, ...] = ()
