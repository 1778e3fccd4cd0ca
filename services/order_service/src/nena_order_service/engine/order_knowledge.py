"""What the dispatcher asks about orders and vehicles: who may execute an order, and at which cost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

from nena_order_service.dispatching.candidates import (
    DispatchedVehicle,
    OrderKind,
    order_types_named,
    stops_of,
    why_not_accepted,
)
from nena_order_service.engine.conditions import Sequences
from nena_order_service.engine.context import Context
from nena_order_service.engine.state import VehicleRecords
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.routing.router import NO_ROUTE, OrderCosts, RouteCosts
from nena_order_service.vehicles.registry import FleetVehicle
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
        set_by_host = self.records.of(vehicle.key).acceptable_order_types
        if set_by_host is not None:
            return set_by_host
        return order_types_named(vehicle.model.acceptable_order_types if vehicle.model else None)

    def set_order_types(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Set the order types that a vehicle accepts; its current order is not affected."""
        self.records.change(vehicle.key, acceptable_order_types=types)


REASONS_KEPT = 1000
"""Maximum number of cached reasons for missing routes, which waiting orders need repeatedly."""

COSTS_KEPT = 4_000
"""Maximum number of orders with cached costs; in large plants, :data:`ENTRIES_KEPT` limits them."""

ENTRIES_KEPT = 1_000_000
"""Maximum number of cached costs of single points."""


class OrderKnowledge:
    """Answers the dispatcher's questions; routes and their costs are cached until the plant changes."""

    def __init__(self, context: Context, fit: OrderFit) -> None:
        self._state = context.state
        self._planner = context.planner
        self._finder = context.planner.finder
        self._registry = context.registry
        self._fit = fit
        self._routes = RouteCosts(context.planner.plant, context.planner.finder)
        self._costs: dict[tuple[int, int, int], OrderCosts] = {}
        """By number and index of the order, and kind of vehicle."""
        self._limit = min(COSTS_KEPT, 1 + ENTRIES_KEPT // (len(context.planner.plant.points) + 1))
        self._why_no_route = lru_cache(REASONS_KEPT)(self._search_route)

    def forget_routes(self) -> None:
        """Drop all cached costs and reasons, because the plant has changed."""
        self._costs.clear()
        self._why_no_route.cache_clear()

    def kind_of(self, order: TransportOrder) -> OrderKind:
        """Return the kind of an order."""
        return self._state.orders.waiting.kind_of(order)

    def vehicles_named_by(self, order: TransportOrder) -> Collection[str]:
        """Return the vehicles that an order excludes, or for which its sequence is."""
        excluded, meant = order.status.excluded_vehicles, self._fit.sequences.only_vehicle(order)
        return (*excluded, meant) if meant and meant not in excluded else excluded

    def why_unsuitable(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason | None:
        """Return, as a predicate, why a vehicle must never execute an order; None if it may."""
        if order.status.automatic:  # for its own vehicle, whatever types a host lets that accept
            return None
        if vehicle.name in order.status.excluded_vehicles:
            return Reason(R.FAILED_BEFORE)
        reason = self._fit.sequences.why_unsuitable(order, vehicle.name)
        return reason or why_not_accepted(vehicle.order_types, order.status.type)

    def recharges_next(self, order: TransportOrder) -> bool:
        """Return whether the next operation of an order is a recharge."""
        return self._planner.recharges(order)

    def first_pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None if it picks up nothing, or drops something before."""
        return self._planner.pick(order)

    def route_costs(
        self, order: TransportOrder, vehicles: Sequence[DispatchedVehicle]
    ) -> Sequence[tuple[float, float]]:
        """Return the costs of each vehicle's route, complete and to the first destination; infinity: none."""
        costs: list[tuple[float, float]] = []
        for kind, group in groupby(vehicles, lambda vehicle: vehicle.routing_kind):
            same_kind = [*group]
            starts = [vehicle.start for vehicle in same_kind]
            try:
                costs += self._costs_from(starts, order, same_kind[0].name, kind)
            except UnknownObjectError:  # the plant lacks a resource to avoid; `why_no_route` names it
                costs += [NO_ROUTE] * len(same_kind)
        return costs

    def _costs_from(
        self, starts: Sequence[str], order: TransportOrder, vehicle: str, kind: int
    ) -> Sequence[tuple[float, float]]:
        key = order.number, order.index, kind
        if cached := self._costs.get(key):
            return cached.costs_from_each(starts)
        stops, model, avoid = stops_of(order), self._registry.model(vehicle), order.resources_to_avoid
        # Costs backwards from the end, for all starts at once, exist only between points of the plant.
        if any(stop.coordinate for stop in stops):
            return [self._routes.cost_of_route(start, stops, vehicle=model, avoid=avoid) for start in starts]
        if len(self._costs) >= self._limit:
            self._costs.clear()
        costs = self._costs[key] = self._routes.costs_of(stops, vehicle=model, avoid=avoid)
        return costs.costs_from_each(starts)

    def outstanding_visits(self) -> Mapping[str | None, int]:
        """Return the number of outstanding visits to each location or point, for assigned orders."""
        assigned = map(self._state.orders.get, self._state.drives.assigned)
        return Counter(stop.location_name for order in assigned for stop in stops_of(order))

    def why_no_route(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason:
        """Return why a vehicle has no route for an order."""
        return self._why_no_route(
            tuple(stops_of(order)), order.resources_to_avoid, vehicle.name, vehicle.start
        )

    def _search_route(
        self, stops: Sequence[Destination], avoid: frozenset[str], vehicle: str, start: str
    ) -> Reason:
        try:
            self._finder.find(start, stops, vehicle=self._registry.model(vehicle), avoid=avoid)
        except (NoRouteError, UnknownObjectError) as error:
            return reason_of(error)
        return Reason(R.TOO_EXPENSIVE)
