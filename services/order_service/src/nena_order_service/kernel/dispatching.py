"""Brings the dispatcher together with the vehicles as they stand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from nena_order_service.dispatch.dispatcher import BUSY, Assignment, decide
from nena_order_service.dispatch.way import Way
from nena_order_service.fleet import NotLocatedError, RobotView, Standing
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.vehicles import FleetVehicle, VehicleRegistry
from nena_order_service.orders.transport_order import TransportOrder

NO_ORDER = "has nothing to do: no order waits"
NO_ORDER_FITS = (
    "has nothing to do: the orders that wait are for other vehicles or of types that it does not accept, "
    "or it cannot reach them"
)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A vehicle that takes an order now, and where it stands."""

    vehicle: FleetVehicle
    standing: Standing


@dataclass(frozen=True, slots=True)
class Dispatched:
    """An assignment and who does it."""

    assignment: Assignment
    candidate: Candidate


class Dispatching:
    """Asks the dispatcher, and says why vehicles have nothing to do."""

    def __init__(
        self,
        registry: VehicleRegistry,
        missions: MissionBook,
        planner: MissionPlanner,
        *,
        view: Callable[[FleetVehicle], RobotView],
        obstacle: Callable[[FleetVehicle], str],
        misfit: Callable[[TransportOrder, FleetVehicle], str],
    ) -> None:
        self._registry = registry
        self._missions = missions
        self._planner = planner
        self._view = view
        self._obstacle = obstacle
        self._misfit = misfit

    def dispatch(self, orders: Sequence[TransportOrder]) -> tuple[list[Dispatched], dict[str, str]]:
        """Give what is to be assigned of orders, most urgent first, and why the others wait, by name."""
        if not orders:
            return [], {}
        candidates: dict[str, Candidate] = {}
        obstacles: dict[str, str] = {}
        vehicles = {vehicle.name: vehicle for vehicle in self._registry}
        for vehicle in vehicles.values():
            if not vehicle.obstacle:
                found = self._consider(vehicle)
                obstacles[vehicle.name] = found if isinstance(found, str) else ""
                if isinstance(found, Candidate):
                    candidates[vehicle.name] = found

        def find_way(order: TransportOrder, name: str) -> Way:
            candidate = candidates[name]
            return self._planner.way(order, candidate.vehicle, candidate.standing)

        def misfit(order: TransportOrder, name: str) -> str:
            return self._misfit(order, vehicles[name])

        decisions = decide(orders, obstacles, find_way, misfit)
        dispatched = [Dispatched(each, candidates[each.vehicle]) for each in decisions.assignments]
        return dispatched, decisions.reasons

    def idle_reason(self, vehicle: FleetVehicle, *, orders_wait: bool) -> str:
        """Say why a vehicle that works on no order has none."""
        if vehicle.obstacle:
            return vehicle.obstacle
        found = self._consider(vehicle)
        if isinstance(found, str):
            return found
        return NO_ORDER_FITS if orders_wait else NO_ORDER

    def _consider(self, vehicle: FleetVehicle) -> Candidate | str:
        """Give the vehicle as a candidate, or as a predicate why it is none."""
        if self._missions.order_number(vehicle.key) is not None:
            return BUSY
        if obstacle := self._obstacle(vehicle):
            return obstacle
        view = self._view(vehicle)
        if not view.availability.can_take_order:
            return view.availability.reason
        try:
            return Candidate(vehicle, self._planner.standing(vehicle, view))
        except NotLocatedError as error:
            return f"cannot be sent anywhere: {error.reason}"
