"""What the ways of a transport order cost, compared for many vehicles without a search for each."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from nena_order_service.dispatch.way import WayFinder, access_points
from nena_order_service.routing import NoRouteError
from nena_order_service.routing.graph import CostMap
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.plant import PlantModel, Vehicle


class WayCost(NamedTuple):
    """What a way costs in the router's unit; infinity where there is none."""

    complete: float
    """All of it."""
    initial: float
    """To the first destination."""


NO_WAY = WayCost(inf, inf)


@dataclass(frozen=True, slots=True)
class _Entry:
    """One point at which the first destination can be served, and what the rest costs from there."""

    to_it: CostMap
    rest: float


@dataclass(frozen=True, slots=True)
class OrderCosts:
    """The costs of one order for vehicles of one routing profile, wherever they start."""

    entries: tuple[_Entry, ...]

    def source(self, point: str) -> WayCost:
        """Give the cost for a vehicle that starts at ``point``."""
        best = NO_WAY
        for entry in self.entries:
            initial = entry.to_it.source(point)
            best = min(best, WayCost(initial + entry.rest, initial))
        return best


class WayCosts:
    """Knows costs of ways over one plant; ways to coordinates are searched for one by one."""

    def __init__(self, plant: PlantModel, finder: WayFinder) -> None:
        self._plant = plant
        self._finder = finder

    def cost(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None,
        avoid: Collection[str] = frozenset(),
    ) -> WayCost:
        """Give the cost of a way as :meth:`WayFinder.find` would find it."""
        if any(each.coordinate for each in destinations):
            return self._searched(start, destinations, vehicle, avoid)
        return self.of(destinations, vehicle=vehicle, avoid=avoid).source(start)

    def of(
        self,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None,
        avoid: Collection[str] = frozenset(),
    ) -> OrderCosts:
        """Give the costs of an order that names no coordinates, looked at from its end."""
        entries: tuple[_Entry, ...] = ()
        later: OrderCosts | None = None
        for destination in reversed(destinations):
            entries = tuple(
                _Entry(
                    self._finder.costs_to(point, vehicle=vehicle, avoid=avoid),
                    later.source(point).complete if later else 0.0,
                )
                for point in access_points(destination, self._plant)
            )
            later = OrderCosts(entries)
        return OrderCosts(entries)

    def _searched(
        self, start: str, destinations: Sequence[Destination], vehicle: Vehicle | None, avoid: Collection[str]
    ) -> WayCost:
        try:
            way = self._finder.find(start, destinations, vehicle=vehicle, avoid=avoid)
        except NoRouteError:
            return NO_WAY
        return WayCost(way.cost, way.legs[0].cost)
