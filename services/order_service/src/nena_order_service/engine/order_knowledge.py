"""What the dispatcher asks about orders and vehicles: who may execute an order, and at which cost."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

from nena_order_service.dispatching.candidates import acceptable, why_not_accepted
from nena_order_service.engine.conditions import Sequences
from nena_order_service.engine.state import VehicleRecords
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import OrderPlanner, Pick
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.routing.router import NO_ROUTE, OrderCosts, RouteCost, RouteCosts
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.fleet_api.reasons import Reason, ReasonCode, reason_of
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.fleet_api.vehicle import AcceptableOrderType
from nena_shared.plant import UnknownObjectError

R = ReasonCode


@dataclass(frozen=True, slots=True)
class OrderFit:
    """Combines the order types and restrictions set by hosts with those of the plant model."""

    records: VehicleRecords
    sequences: Sequences

    def order_types(self, vehicle: FleetVehicle) -> tuple[AcceptableOrderType, ...]:
        """Return the order types that a vehicle accepts: those set by hosts, otherwise the plant model's."""
        chosen = self.records.of(vehicle.key).acceptable_order_types
        if chosen is not None:
            return chosen
        return acceptable(vehicle.model.acceptable_order_types if vehicle.model else None)

    def accept(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Set the order types that a vehicle accepts; its current order is not affected."""
        self.records.change(vehicle.key, acceptable_order_types=types)

    def why_unsuitable(self, order: TransportOrder, vehicle: FleetVehicle) -> str:
        """Return, as a predicate, why a vehicle must not execute an order; empty if it may."""
        if vehicle.name in order.status.excluded_vehicles:
            return Reason(R.FAILED_BEFORE)
        why = self.sequences.why_unsuitable(order, vehicle.name)
        return why or why_not_accepted(self.order_types(vehicle), order.status.type)


REASONS_KEPT = 1000
"""Maximum number of cached reasons for missing routes, which waiting orders need repeatedly."""

COSTS_KEPT = 4_000
"""Maximum number of orders with cached costs, for each kind of vehicle."""

ENTRIES_KEPT = 1_000_000
"""Maximum number of cached costs of single points; in large plants, it limits the orders instead."""


class KnownCosts:
    """Costs of routes, and reasons for missing routes, cached until the plant changes."""

    def __init__(self, planner: OrderPlanner, registry: VehicleRegistry) -> None:
        self.planner = planner
        self.finder = planner.finder
        self.registry = registry
        self.ways = RouteCosts(planner.plant, planner.finder)
        self._why = lru_cache(REASONS_KEPT)(self._find_out_why)
        self._orders: OrderedDict[tuple[int, int, int], OrderCosts] = OrderedDict()
        self._limit = min(COSTS_KEPT, 1 + ENTRIES_KEPT // (len(planner.plant.points) + 1))

    def forget(self) -> None:
        """Drop all cached routes and reasons for missing ones."""
        self._why.cache_clear()
        self._orders.clear()

    def of(self, order: TransportOrder, vehicle: FleetVehicle, kind: int) -> OrderCosts:
        """Compute the costs of an order without coordinates, for vehicles of a kind."""
        found = self.ways.of(stops_of(order), vehicle=vehicle.model, avoid=order.resources_to_avoid)
        self._orders[order.number, order.index, kind] = found
        if len(self._orders) > self._limit:
            self._orders.popitem(last=False)
        return found

    def known(self, order: TransportOrder, kind: int) -> OrderCosts | None:
        """Return the cached costs of an order for vehicles of a kind, if any."""
        key = order.number, order.index, kind
        found = self._orders.get(key)
        if found:
            self._orders.move_to_end(key)
        return found

    def why_no_route(self, order: TransportOrder, vehicle: str, start: str) -> str:
        """Return why a vehicle that starts at a point has no route."""
        stops = tuple(stops_of(order))
        return self._why(stops, order.resources_to_avoid, vehicle, start)

    def _find_out_why(
        self, stops: Sequence[Destination], avoid: frozenset[str], vehicle: str, start: str
    ) -> str:
        try:
            self.finder.find(start, stops, vehicle=self.registry.model(vehicle), avoid=avoid)
        except (NoRouteError, UnknownObjectError) as error:
            return reason_of(error)
        return Reason(R.TOO_EXPENSIVE)


class OrderKnowledge:
    """Provides the dispatcher with facts about orders and vehicles during one decision."""

    def __init__(
        self,
        costs: KnownCosts,
        places: Mapping[str, tuple[FleetVehicle, str]],
        planner: OrderPlanner,
        fit: OrderFit,
        assigned: Callable[[], Iterable[TransportOrder]],
    ) -> None:
        """``places`` maps vehicles that may get orders to their start points.

        ``assigned`` returns the orders that vehicles are executing.
        """
        self._costs = costs
        self._places = places
        self._planner = planner
        self._fit = fit
        self._assigned = assigned
        self._kinds = {name: costs.finder.router.kind(each.model) for name, (each, _) in places.items()}

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> str:
        """Return, as a predicate, why a vehicle must never execute an order; empty if it may."""
        known = self._costs.registry.named(vehicle)
        return "" if known is None or order.status.automatic else self._fit.why_unsuitable(order, known)

    def recharges(self, order: TransportOrder) -> bool:
        """Return whether the next operation of an order is a recharge."""
        return self._planner.recharges(order)

    def pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None if it picks up nothing, or drops something before."""
        return self._planner.pick(order)

    def cost(self, order: TransportOrder, vehicle: str) -> RouteCost:
        """Return the cost of a vehicle's route through an order's destinations; infinite without a route."""
        try:
            return self._cost(order, vehicle)
        except UnknownObjectError:  # the plant lacks a resource to avoid; `why_no_route` names it
            return NO_ROUTE

    def _cost(self, order: TransportOrder, vehicle: str) -> RouteCost:
        who, start = self._places[vehicle]
        if known := self._costs.known(order, self._kinds[vehicle]):
            return known.source(start)
        stops = stops_of(order)
        if any(each.coordinate for each in stops):
            return self._costs.ways.cost(start, stops, vehicle=who.model, avoid=order.resources_to_avoid)
        return self._costs.of(order, who, self._kinds[vehicle]).source(start)

    def crowd(self, order: TransportOrder) -> int:
        """Return how many visits to the order's destinations are outstanding for assigned orders."""
        return sum(self._visits[each.location_name] for each in stops_of(order))

    @cached_property
    def _visits(self) -> Counter[str | None]:
        """The number of outstanding visits to each location or point."""
        stops = (each.location_name for order in self._assigned() for each in stops_of(order))
        return Counter(name for name in stops if name is not None)

    def why_no_route(self, order: TransportOrder, vehicle: str) -> str:
        """Return why a vehicle has no route for an order."""
        return self._costs.why_no_route(order, vehicle, self._places[vehicle][1])


def stops_of(order: TransportOrder) -> list[Destination]:
    """Return the destinations that have not been reached yet."""
    return [each.destination for each in order.status.drive_orders[order.index :]]
