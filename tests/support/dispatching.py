"""The dispatcher's knowledge, as defined by a test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf
from typing import Any

from nena_order_service.dispatching.candidates import DispatchedVehicle
from nena_order_service.dispatching.dispatcher import Decisions
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.routing.router import RouteCost


@dataclass(frozen=True)
class Told:
    """Knowledge with given costs by vehicle, or by order and vehicle; without a cost there is no route."""

    costs: Mapping[Any, float] = field(default_factory=dict)
    unsuitable: Mapping[tuple[str, str], str] = field(default_factory=dict)
    """Why vehicles must not do orders of a type, by type and vehicle."""

    crowds: Mapping[str, int] = field(default_factory=dict)
    """How many vehicles are to come to the destinations of orders, by name."""

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> str:
        return self.unsuitable.get((order.status.type, vehicle), "")

    def recharges(self, order: TransportOrder) -> bool:
        return order.current.destination.operation == "Charge"

    def pick(self, order: TransportOrder) -> Pick | None:
        return Pick() if order.current.destination.operation == "Load" else None

    def cost(self, order: TransportOrder, vehicle: str) -> RouteCost:
        cost = self.costs.get((order.name, vehicle), self.costs.get(vehicle, inf))
        return RouteCost(cost, cost)

    def crowd(self, order: TransportOrder) -> int:
        return self.crowds.get(order.name, 0)

    def why_no_route(self, order: TransportOrder, vehicle: str) -> str:
        return f"No route for {order.name} and {vehicle}."


def vehicles(**obstacles: str) -> list[DispatchedVehicle]:
    """Make vehicles with what keeps each from taking orders."""
    return [DispatchedVehicle(name, obstacle) for name, obstacle in obstacles.items()]


def pairs(decisions: Decisions) -> dict[str, str]:
    """Return the vehicles of the orders that were assigned."""
    return {each.order.name: each.vehicle for each in decisions.assignments}
