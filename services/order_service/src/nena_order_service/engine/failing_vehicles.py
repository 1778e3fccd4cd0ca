"""Take vehicles out of dispatching at which one order after the other fails."""

from __future__ import annotations

from typing import Final

from nena_order_service.engine.context import Context
from nena_order_service.fleet.failures import FailureKind, OrderFailure
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.log import get_logger
from nena_shared.vda5050.state import EmergencyStop
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

K = FailureKind
R = ReasonCode

OF_ROBOTS: Final = frozenset({K.REFUSED, K.NOT_TAKEN, K.DRIVE, K.ACTION, K.LOST})
"""Failures for which a robot may be the cause. A missing route and what its factsheet rules out are none, and
after UNCLEAR ones a person has to look anyway."""

FAILURES_KEPT: Final = 100
"""Number of a vehicle's last failures that are stored, the highest limit."""

DESTINATIONS_KEPT: Final = 1000
"""Number of failed destinations kept; an order may name any coordinate."""


class FailingVehicles:
    """Counts the orders that fail in a row at a vehicle, and takes it out of dispatching at the limit.

    Otherwise a robot that cannot drive would be free again after seconds, and would take all waiting orders.
    A failure does not count, because the destination is its likely cause, if another vehicle has also failed
    there and, since its last finished drive, nowhere else. So an impossible order takes no vehicle out, but
    a fleet in which every drive fails keeps its orders.
    """

    def __init__(self, context: Context) -> None:
        self._state = context.state
        self._records = context.state.vehicles
        self._limit = context.settings.dispatch.failed_orders
        self._view = context.view
        self._failed_at: dict[str, set[RobotKey]] = {}
        """The robots that have failed at each destination since the last success there."""

    def restore(self) -> None:
        """Restore after a restart which robots have failed at each destination."""
        for record in self._records:
            for place in record.failed_at:
                self._add_failed_robot(place, record.robot)

    def on_failed_order(self, vehicle: FleetVehicle, destination: Destination, failure: OrderFailure) -> None:
        """Count an order that has failed at a vehicle; take the vehicle out at the limit."""
        if failure.kind not in OF_ROBOTS or failure.by_device:
            return
        state = self._view(vehicle).state
        if state and (
            state.safety_state.active_emergency_stop is not EmergencyStop.NONE
            or not state.operating_mode.takes_orders
        ):
            return  # a person has stopped the robot or taken it over
        place, record = _place_of(destination), self._records.of(vehicle.key)
        failed_at = (*record.failed_at, place)[-FAILURES_KEPT:]
        self._records.change(vehicle.key, failed_at=failed_at)
        self._add_failed_robot(place, vehicle.key)
        count = sum(not self._is_likely_cause(failed_place, vehicle.key) for failed_place in failed_at)
        if not 0 < self._limit <= count or record.integration_level is not IntegrationLevel.TO_BE_UTILIZED:
            return
        reason = Reason(R.TAKEN_OUT, failure.words, count=count)
        log.warning("vehicle is taken out of dispatching", vehicle=vehicle.name, reason=str(reason))
        level = IntegrationLevel.TO_BE_RESPECTED
        self._set_level(vehicle, level, taken_out=str(reason), coded_taken_out=reason.coded)

    def on_finished_drive(self, vehicle: FleetVehicle, destination: Destination | None = None) -> None:
        """Note a finished drive, to ``destination`` or out of the way of others: the vehicle works."""
        if destination:
            self._failed_at.pop(_place_of(destination), None)
        record = self._records.of(vehicle.key)
        if record.taken_out:
            log.info("vehicle is back in dispatching", vehicle=vehicle.name)
            level = IntegrationLevel.TO_BE_UTILIZED
            self._set_level(vehicle, level, failed_at=(), taken_out="", coded_taken_out=None)
        elif record.failed_at:
            self._records.change(vehicle.key, failed_at=())

    def _set_level(self, vehicle: FleetVehicle, level: IntegrationLevel, **changes: object) -> None:
        self._records.change(vehicle.key, integration_level=level, **changes)
        self._state.vehicle_changed(vehicle.name)
        self._state.dispatch_due = True

    def _add_failed_robot(self, place: str, robot: RobotKey) -> None:
        self._failed_at.setdefault(place, set()).add(robot)
        if len(self._failed_at) > DESTINATIONS_KEPT:  # the oldest one
            del self._failed_at[next(iter(self._failed_at))]

    def _is_likely_cause(self, place: str, robot: RobotKey) -> bool:
        """Return whether a destination itself is likely the cause of a robot's failure there."""
        other_robots = self._failed_at.get(place, set()) - {robot}
        return any({*self._records.of(other).failed_at} <= {place} for other in other_robots)


def _place_of(destination: Destination) -> str:
    return destination.location_name or str(destination.coordinate)
