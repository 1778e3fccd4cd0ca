"""What the dispatcher knows of orders and vehicles: who may do what, and what the ways cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from nena_order_service.dispatch.load_room import Pick
from nena_order_service.dispatch.way import WayFinder
from nena_order_service.dispatch.way_costs import OrderCosts, WayCost, WayCosts
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.order_fit import OrderFit
from nena_order_service.kernel.vehicles import FleetVehicle, VehicleRegistry
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing import NoRouteError
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.plant import PlantModel

REASONS_KEPT = 1000
"""Why there is no way: asked for again and again for each order that waits for one."""


class KnownCosts:
    """Costs of ways, and why there is none; remembered until the plant changes."""

    def __init__(self, plant: PlantModel, finder: WayFinder, registry: VehicleRegistry) -> None:
        self.finder = finder
        self.registry = registry
        self.ways = WayCosts(plant, finder)
        self._why = lru_cache(REASONS_KEPT)(self._find_out_why)

    def forget(self) -> None:
        """Ask anew why there is no way; the router forgets costs by itself."""
        self._why.cache_clear()

    def why_no_way(self, order: TransportOrder, vehicle: str, start: str) -> str:
        """Say why a vehicle that starts at a point has no way."""
        stops = tuple(_stops(order))
        return self._why(stops, order.resources_to_avoid, vehicle, start)

    def _find_out_why(
        self, stops: Sequence[Destination], avoid: frozenset[str], vehicle: str, start: str
    ) -> str:
        try:
            self.finder.find(start, stops, vehicle=self.registry.model(vehicle), avoid=avoid)
        except NoRouteError as error:
            return str(error)
        return "it costs too much"


class OrderKnowledge:
    """What the dispatcher asks during one decision."""

    def __init__(
        self,
        costs: KnownCosts,
        places: Mapping[str, tuple[FleetVehicle, str]],
        planner: MissionPlanner,
        fit: OrderFit,
    ) -> None:
        """``places`` gives vehicles that may get orders, and the points from which they would start."""
        self._costs = costs
        self._places = places
        self._planner = planner
        self._fit = fit
        self._kinds = {name: costs.finder.kind(each.model) for name, (each, _) in places.items()}
        self._known: dict[tuple[int, int], OrderCosts] = {}

    def misfit(self, order: TransportOrder, vehicle: str) -> str:
        """Say, as a predicate, why a vehicle must not do an order at all; empty where it may."""
        known = self._costs.registry.named(vehicle)
        return "" if known is None or order.status.automatic else self._fit.misfit(order, known)

    def recharges(self, order: TransportOrder) -> bool:
        """Tell whether the next thing that an order asks for is to recharge."""
        return self._planner.recharges(order)

    def pick(self, order: TransportOrder) -> Pick | None:
        """Give what an order begins with picking up; None: it picks up nothing, or drops something first."""
        return self._planner.pick(order)

    def cost(self, order: TransportOrder, vehicle: str) -> WayCost:
        """Give the cost of a vehicle's way through an order's destinations; infinity where there is none."""
        who, start = self._places[vehicle]
        stops = _stops(order)
        if any(each.coordinate for each in stops):
            return self._costs.ways.cost(start, stops, vehicle=who.model, avoid=order.resources_to_avoid)
        key = order.number, self._kinds[vehicle]
        known = self._known.get(key)
        if known is None:
            known = self._costs.ways.of(stops, vehicle=who.model, avoid=order.resources_to_avoid)
            self._known[key] = known
        return known.source(start)

    def why_no_way(self, order: TransportOrder, vehicle: str) -> str:
        """Say why there is no way."""
        return self._costs.why_no_way(order, vehicle, self._places[vehicle][1])


def _stops(order: TransportOrder) -> list[Destination]:
    """Give the destinations that are not reached yet."""
    return [each.destination for each in order.status.drive_orders[order.index :]]
