"""Vehicles as hosts see and command them: status, integration level, accepted order types, rerouting."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final

from pydantic import Field

from nena_shared.fleet_api.base import Moment, Request, Resource
from nena_shared.fleet_api.traffic import TrafficWait

ANY_TYPE: Final = "*"
"""Accepted by it, an order may be of any type."""

OrderType = Annotated[str, Field(min_length=1, max_length=100)]
"""Free text; ``Transport``, ``Charge`` and ``Park`` are customary, ``-`` stands for an order without one."""


class AcceptableOrderType(Request):
    """A type of orders that a vehicle accepts."""

    name: OrderType
    """``*``: any."""
    priority: Annotated[int, Field(ge=-1000, le=1000)] = 0
    """Smaller is preferred, if the dispatcher uses it."""


ANY_ORDER_TYPE: Final = (AcceptableOrderType(name=ANY_TYPE),)
"""Default of vehicles for which nothing else is configured."""


class VehicleState(StrEnum):
    """What the robot reports, in openTCS's words."""

    UNKNOWN = "UNKNOWN"
    UNAVAILABLE = "UNAVAILABLE"
    ERROR = "ERROR"
    IDLE = "IDLE"
    EXECUTING = "EXECUTING"
    CHARGING = "CHARGING"


class ProcessingState(StrEnum):
    """What the order service does with it."""

    IDLE = "IDLE"
    AWAITING_ORDER = "AWAITING_ORDER"
    """It is bound to an order sequence, and waits for the next order of it."""
    PROCESSING_ORDER = "PROCESSING_ORDER"


class IntegrationLevel(StrEnum):
    """How much a vehicle counts, in openTCS's words."""

    TO_BE_IGNORED = "TO_BE_IGNORED"
    """As if it were not there."""
    TO_BE_NOTICED = "TO_BE_NOTICED"
    """It is shown; nothing is kept free for it."""
    TO_BE_RESPECTED = "TO_BE_RESPECTED"
    """Its resources are kept free; it gets no orders."""
    TO_BE_UTILIZED = "TO_BE_UTILIZED"
    """It also gets orders."""

    @property
    def holds_resources(self) -> bool:
        """Whether others are kept away from such a vehicle."""
        return self in (IntegrationLevel.TO_BE_RESPECTED, IntegrationLevel.TO_BE_UTILIZED)


class PrecisePosition(Resource):
    """m and rad in the plant's frame."""

    x: float
    y: float
    theta: float
    map_id: str


class RobotMap(Resource):
    """A map that a robot has, in one version."""

    map_id: str
    map_version: str
    enabled: bool
    """Whether the robot uses this version."""


class VehicleStatus(Resource):
    """State of one vehicle."""

    name: str
    manufacturer: str
    serial_number: str
    state: VehicleState
    processing_state: ProcessingState
    integration_level: IntegrationLevel = IntegrationLevel.TO_BE_UTILIZED
    acceptable_order_types: tuple[AcceptableOrderType, ...] = ANY_ORDER_TYPE
    """Orders of other types it does not get."""
    reason: str
    """Why it is in this state, or why it is idle, in words."""
    wait: TrafficWait | None = None
    """For whom it waits, where and why; None: nothing keeps it."""
    connection: str
    """ONLINE, OFFLINE, CONNECTION_BROKEN, HIBERNATING; SILENT: no state for too long; UNKNOWN: none ever."""
    operating_mode: str | None = None
    current_position: str | None = None
    """Name of the point that it is at or was at last."""
    precise_position: PrecisePosition | None = None
    maps: tuple[RobotMap, ...] | None = None
    """The maps on its robot, by its last state; None: not reported."""
    energy_level: float | None = None
    """Percent."""
    transport_order: str | None = None
    order_sequence: str | None = None
    """The order sequence to which it is bound: it does nothing else until that is finished."""
    errors: tuple[str, ...] = ()
    deviations: tuple[str, ...] = ()
    """How its robot's messages deviate from VDA 5050, and how they were read, in words."""
    last_state: Moment | None = None


class ReroutingType(StrEnum):
    """Start of the new route."""

    REGULAR = "REGULAR"
    """From the end of the base: the robot continues without a stop, by an order update."""
    FORCED = "FORCED"
    """From the robot's position: its order is cancelled first, and it gets a new one."""


class ReroutingOutcome(StrEnum):
    """What has become of a request for rerouting."""

    REROUTED = "REROUTED"
    """The vehicle rerouted."""
    UNCHANGED = "UNCHANGED"
    """The route stays; the reason explains it."""
    STOPPING = "STOPPING"
    """The robot stops, at once or at the end of its base, and continues from there."""


class ReroutingAnswer(Resource):
    """Answer to a request for rerouting."""

    vehicle: str
    transport_order: str
    outcome: ReroutingOutcome
    reason: str
    """In words."""
    route: tuple[str, ...] = ()
    """The points from the end of the base to the destination, if the route is known."""
