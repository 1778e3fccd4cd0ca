"""Vehicles in the API: status, integration level, accepted order types, rerouting."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final

from pydantic import Field

from nena_shared.fleet_api.base import Moment, Request, Resource
from nena_shared.fleet_api.reasons import OptionalReason
from nena_shared.fleet_api.stops import SetBy, VehicleStop
from nena_shared.fleet_api.traffic import TrafficWait

ANY_TYPE: Final = "*"
"""Wildcard: accepts orders of any type."""

OrderType = Annotated[str, Field(min_length=1, max_length=100)]
"""Order type, free text. Common: ``Transport``, ``Charge``, ``Park``; ``-`` for orders without a type."""


class AcceptableOrderType(Request):
    """An order type that a vehicle accepts."""

    name: OrderType
    """``*``: any."""
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """Lower is preferred, if the dispatcher uses priorities."""


ANY_ORDER_TYPE: Final = (AcceptableOrderType(name=ANY_TYPE),)
"""Default of vehicles without their own configuration."""


class VehicleState(StrEnum):
    """State of the robot, with openTCS's names."""

    UNKNOWN = "UNKNOWN"
    UNAVAILABLE = "UNAVAILABLE"
    ERROR = "ERROR"
    IDLE = "IDLE"
    EXECUTING = "EXECUTING"
    CHARGING = "CHARGING"


class ProcessingState(StrEnum):
    """How the order service uses a vehicle."""

    IDLE = "IDLE"
    AWAITING_ORDER = "AWAITING_ORDER"
    """Reserved for an order sequence, waiting for its next order."""
    PROCESSING_ORDER = "PROCESSING_ORDER"


class IntegrationLevel(StrEnum):
    """Integration level of a vehicle, with openTCS's names."""

    TO_BE_IGNORED = "TO_BE_IGNORED"
    """Ignored completely."""
    TO_BE_NOTICED = "TO_BE_NOTICED"
    """Shown; reserves no resources."""
    TO_BE_RESPECTED = "TO_BE_RESPECTED"
    """Reserves its resources, but receives no orders."""
    TO_BE_UTILIZED = "TO_BE_UTILIZED"
    """Reserves its resources and receives orders."""

    @property
    def holds_resources(self) -> bool:
        """Whether other vehicles avoid the resources of such a vehicle."""
        return self in (IntegrationLevel.TO_BE_RESPECTED, IntegrationLevel.TO_BE_UTILIZED)


class PrecisePosition(Resource):
    """Position, m and rad in the plant frame."""

    x: float
    y: float
    theta: float
    map_id: str


class RobotMap(Resource):
    """A version of a map on a robot."""

    map_id: str
    map_version: str
    enabled: bool
    """Whether the robot uses this version."""


class VehicleStatus(Resource):
    """State of a vehicle."""

    name: str
    manufacturer: str
    serial_number: str
    state: VehicleState
    processing_state: ProcessingState
    integration_level: IntegrationLevel = IntegrationLevel.TO_BE_UTILIZED
    level_set: SetBy | None = None
    """Who has set a level other than TO_BE_UTILIZED; None: nobody, or before it was recorded."""
    acceptable_order_types: tuple[AcceptableOrderType, ...] = ANY_ORDER_TYPE
    """Accepted order types; other orders are not assigned to it."""
    taken_out: bool = False
    """Whether it gets no orders because too many in a row have failed at it; see its reason."""
    reason: str
    """Reason for the state, or for being idle, as text."""
    coded_reason: OptionalReason = None
    wait: TrafficWait | None = None
    """The vehicles it waits for, where and why; None: not waiting."""
    stop: VehicleStop | None = None
    """The stop that pauses it; None: no stop."""
    connection: str
    """ONLINE, OFFLINE, CONNECTION_BROKEN, HIBERNATING; SILENT: no state for too long; UNKNOWN: none ever."""
    operating_mode: str | None = None
    active_emergency_stop: str | None = None
    """NONE, MANUAL or REMOTE, as reported; None: not reported yet."""
    field_violation: bool = False
    """Whether its protective field is violated."""
    paused: bool = False
    localized: bool | None = None
    """Whether it knows its position; None: it does not report positions."""
    current_position: str | None = None
    """Current or last point."""
    precise_position: PrecisePosition | None = None
    maps: tuple[RobotMap, ...] | None = None
    """Maps on the robot, from its last state; None: not reported."""
    energy_level: float | None = None
    """Percent."""
    transport_order: str | None = None
    order_sequence: str | None = None
    """Order sequence for which the vehicle is reserved until it is finished."""
    errors: tuple[str, ...] = ()
    deviations: tuple[str, ...] = ()
    """How the robot's messages deviate from VDA 5050, and how they were read, as text."""
    last_state: Moment | None = None


class ReroutingType(StrEnum):
    """Start of the new route."""

    REGULAR = "REGULAR"
    """From the end of the base: an order update, without a stop."""
    FORCED = "FORCED"
    """From the robot's position: the order is cancelled and replaced."""


class ReroutingOutcome(StrEnum):
    """Result of a rerouting request."""

    REROUTED = "REROUTED"
    """The vehicle has a new route."""
    UNCHANGED = "UNCHANGED"
    """The route is unchanged; the reason explains why."""
    STOPPING = "STOPPING"
    """The robot stops, immediately or at the end of its base, and continues from there."""


class ReroutingAnswer(Resource):
    """Answer to a rerouting request."""

    vehicle: str
    transport_order: str
    outcome: ReroutingOutcome
    reason: str
    """Reason, as text."""
    coded_reason: OptionalReason = None
    route: tuple[str, ...] = ()
    """Points from the end of the base to the destination, if the route is known."""
