"""Which orders a vehicle may be given at all, whatever it does now."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.dispatch.order_types import acceptable, why_not_accepted
from nena_order_service.kernel.sequences import Sequences
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.order_types import AcceptableOrderType


@dataclass(frozen=True, slots=True)
class OrderFit:
    """Joins what hosts and the plant model say of vehicles and orders."""

    book: VehicleBook
    sequences: Sequences

    def order_types(self, vehicle: FleetVehicle) -> tuple[AcceptableOrderType, ...]:
        """Give the types of orders that a vehicle accepts: what hosts have said, else the plant model."""
        said = self.book.of(vehicle.key).acceptable_order_types
        if said is not None:
            return said
        return acceptable(vehicle.model.acceptable_order_types if vehicle.model else None)

    def accept(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Let a vehicle accept orders of these types from now on; an order that it has it does to the end."""
        self.book.change(vehicle.key, acceptable_order_types=types)

    def misfit(self, order: TransportOrder, vehicle: FleetVehicle) -> str:
        """Say, as a predicate, why a vehicle must not be given an order; empty where it may."""
        if vehicle.name in order.status.excluded_vehicles:
            return "has failed at it"
        why = self.sequences.misfit(order, vehicle.name)
        return why or why_not_accepted(self.order_types(vehicle), order.status.type)
