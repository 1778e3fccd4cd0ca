"""The ways of the fleet's vehicles, as traffic asks for them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import lru_cache

from nena_order_service.dispatching.way import RouteFinder
from nena_order_service.routing import NoRouteError, Route
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.plant import Vehicle

ROUTES_KEPT = 2_000
"""Routes that are remembered, of a few kB each; a request that waits asks for the same one each time."""


class VehicleRoutes:
    """Finds routes as the plant model's data of each vehicle let it drive, and remembers them."""

    def __init__(self, finder: RouteFinder, registry: VehicleRegistry) -> None:
        self._finder = finder
        self._registry = registry
        self._route = lru_cache(ROUTES_KEPT)(self._find)

    def route(self, vehicle: str, start: str, goal: str, *, avoid: Collection[str] = frozenset()) -> Route:
        """Return the cheapest route; raises NoRouteError."""
        found = self._route(self._model(vehicle), start, goal, frozenset(avoid))
        if isinstance(found, NoRouteError):
            raise found.with_traceback(None)
        return found

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Return what it costs to reach each point that can be reached."""
        return self._finder.costs(start, vehicle=self._registry.model(vehicle))

    def forget(self) -> None:
        """Ask anew for each route: the plant has changed."""
        self._route.cache_clear()

    def _model(self, vehicle: str) -> str | None:
        return vehicle if self._registry.model(vehicle) else None

    def _find(
        self, vehicle: str | None, start: str, goal: str, avoid: frozenset[str]
    ) -> Route | NoRouteError:
        """Return what is remembered: that there is no way costs as much to find out as one."""
        model: Vehicle | None = self._registry.model(vehicle) if vehicle else None
        try:
            return self._finder.route(start, goal, vehicle=model, avoid=avoid)
        except NoRouteError as error:
            return error
