"""How vehicles stand, put together from all that the kernel knows of them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta

from nena_order_service.dispatching.manager import Dispatching, OrderFit
from nena_order_service.fleet import RobotView
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.vehicle_status import Essentials, essentials, vehicle_status
from nena_order_service.orders.sequences import Sequences
from nena_order_service.traffic.desk import TrafficDesk
from nena_order_service.vehicles.idle import IdleVehicles
from nena_order_service.vehicles.positions import Places
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.plant import PlantModel


class VehicleOutlook:
    """Tells how vehicles stand, and why those without an order have none."""

    def __init__(
        self,
        plant: PlantModel,
        *,
        book: OrderBook,
        missions: MissionBook,
        places: Places,
        fit: OrderFit,
        sequences: Sequences,
        dispatching: Dispatching,
        idle: IdleVehicles,
        desk: TrafficDesk,
        registry: VehicleRegistry,
        clock: Clock,
        view: Callable[[FleetVehicle], RobotView],
    ) -> None:
        self._plant = plant
        self._book = book
        self._missions = missions
        self._places = places
        self._fit = fit
        self._sequences = sequences
        self._dispatching = dispatching
        self._idle = idle
        self._desk = desk
        self._registry = registry
        self._clock = clock
        self._view = view

    def status_of(self, name: str) -> VehicleStatus | None:
        """Tell how the vehicle of a name stands, None: there is none."""
        vehicle = self._registry.named(name)
        return self.status(vehicle) if vehicle else None

    def status(self, vehicle: FleetVehicle) -> VehicleStatus:
        """Tell how a vehicle stands."""
        view = self._view(vehicle)
        age = None if view.state_at is None else timedelta(seconds=self._clock.monotonic() - view.state_at)
        last_state = None if age is None else self._clock.now() - age
        return vehicle_status(vehicle, view, self._essentials(vehicle, view), last_state)

    def essentials(self, vehicle: FleetVehicle) -> Essentials:
        """Tell what matters of how a vehicle stands; a tenth of the work of telling all."""
        return self._essentials(vehicle, self._view(vehicle))

    def _essentials(self, vehicle: FleetVehicle, view: RobotView) -> Essentials:
        order = self._book.visible(self._missions.order_number(vehicle.key))
        order = order if order and order.vehicle == vehicle.name else None
        return essentials(
            vehicle,
            view,
            plant=self._plant,
            level=self._places.level(vehicle),
            order_types=self._fit.order_types(vehicle),
            transport_order=order.name if order else None,
            order_sequence=self._sequences.bound_to(vehicle.name),
            reason=order.status.reason if order else self._idle_reason(vehicle),
        )

    def _idle_reason(self, vehicle: FleetVehicle) -> str:
        reason = self._dispatching.idle_reason(vehicle, orders_wait=self._book.orders_wait)
        bound = self._sequences.bound_to(vehicle.name)
        awaits = f"awaits the next order of order sequence {bound!r}" if bound else ""
        more = (awaits, self._idle.note(vehicle), self._desk.sharing(vehicle.name))
        return "; ".join(filter(None, (reason, *more)))
