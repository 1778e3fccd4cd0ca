"""The dispatcher's knowledge, as defined by a test."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from nena_order_service.dispatching.candidates import DispatchedVehicle, OrderKind, kind_of
from nena_order_service.dispatching.dispatcher import Decisions
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_shared.fleet_api.reasons import Reason


@dataclass(frozen=True)
class Told:
    """Knowledge with given costs by vehicle, or by order and vehicle; without a cost there is no route."""

    costs_of: Mapping[Any, float] = field(default_factory=dict)
    unsuitable: Mapping[tuple[str, str], Reason] = field(default_factory=dict)
    """Why vehicles must not do orders of a type, by type and vehicle."""

    coming: Mapping[str | None, int] = field(default_factory=dict)
    """How many vehicles are to come to locations."""

    def kind_of(self, order: TransportOrder) -> OrderKind:
        return kind_of(order)

    def vehicles_named_by(self, order: TransportOrder) -> Collection[str]:
        return order.status.excluded_vehicles

    def why_unsuitable(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason | None:
        return self.unsuitable.get((order.status.type, vehicle.name))

    def recharges_next(self, order: TransportOrder) -> bool:
        return order.current.destination.operation == "Charge"

    def first_pick(self, order: TransportOrder) -> Pick | None:
        return Pick() if order.current.destination.operation == "Load" else None

    def route_costs(
        self, order: TransportOrder, vehicles: Sequence[DispatchedVehicle]
    ) -> Sequence[tuple[float, float]]:
        named = ((order.name, vehicle.name) for vehicle in vehicles)
        costs = (self.costs_of.get(pair, self.costs_of.get(pair[1], inf)) for pair in named)
        return [(cost, cost) for cost in costs]

    def outstanding_visits(self) -> Mapping[str | None, int]:
        return self.coming

    def why_no_route(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason:
        return Reason.of(f"No route for {order.name} and {vehicle.name}.")


def vehicles(**obstacles: Reason | str) -> list[DispatchedVehicle]:
    """Make vehicles with what keeps each from taking orders."""
    return [
        DispatchedVehicle(name, Reason.of(obstacle) if obstacle else None)
        for name, obstacle in obstacles.items()
    ]


def reasons(decisions: Decisions) -> dict[str, str]:
    """Return why the other orders wait, as text."""
    return {order: str(reason) for order, reason in decisions.reasons.items()}


def pairs(decisions: Decisions) -> dict[str, str]:
    """Return the vehicles of the orders that were assigned."""
    return {each.order.name: each.vehicle for each in decisions.assignments}
