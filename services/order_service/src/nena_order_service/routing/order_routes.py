"""Routes through the destinations of an order, their costs, and the routes that traffic control requests."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from math import hypot, inf
from typing import NamedTuple

from nena_order_service.routing.graph import CostMap, NoRouteError, Route
from nena_order_service.routing.router import Router
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_shared.histogram import SHORT, Histogram
from nena_shared.plant import PlantModel, Point, Vehicle

MM_PER_M = 1000.0


@dataclass(frozen=True, slots=True)
class Leg:
    """The way of one drive order: along a route, or without one straight to its coordinate."""

    cost: float
    """In the router's unit; mm to a coordinate."""
    route: Route | None = None

    @property
    def points(self) -> tuple[str, ...]:
        """The names of all points on the way, with both ends; none on the way to a coordinate."""
        return self.route.points if self.route else ()


@dataclass(frozen=True, slots=True)
class RoutePlan:
    """One leg for each destination."""

    legs: tuple[Leg, ...]

    @property
    def cost(self) -> float:
        """The sum of the legs' costs."""
        return sum(leg.cost for leg in self.legs)


def access_points(destination: Destination, plant: PlantModel) -> tuple[str, ...]:
    """Return the points at which a destination that is no coordinate can be served."""
    name = destination.location_name or ""
    return plant.access_points(name, destination.operation) if name in plant.locations_by_name else (name,)


class RouteFinder:
    """Finds routes over one plant: along paths to points and locations, straight to coordinates.

    From a coordinate, the route continues at the nearest point.
    """

    def __init__(self, plant: PlantModel, router: Router, any_day: Router | None = None) -> None:
        """Use a router; ``any_day`` is another one, for what could be done if hosts unlocked paths."""
        self._plant = plant
        self.router = router
        self._any_day = any_day or router
        self._locks: Mapping[str, bool] = {}
        self.planning = Histogram(SHORT)
        """How long :meth:`find` takes."""

    def set_locks(self, locks: Mapping[str, bool]) -> None:
        """Lock or unlock paths by name, overriding the plant model.

        A path locked in this way closes routes now, but makes no order permanently unroutable.
        """
        self._any_day.set_locks({path: locked for path, locked in locks.items() if not locked})
        self.router.set_locks(locks)
        self._locks = dict(locks)

    def prepare(self, vehicles: Iterable[Vehicle | None]) -> None:
        """Build what the first routes of these vehicles need, and those of no certain vehicle."""
        each_kind = {self.router.kind(vehicle): vehicle for vehicle in (None, *vehicles)}
        self.router.prepare(each_kind.values())
        self._any_day.prepare((None,))

    def is_locked(self, path: str) -> bool:
        """Return whether new routes keep off a path; what is no path of the plant is not locked."""
        known = self._plant.paths_by_name.get(path)
        return known is not None and self._locks.get(path, known.locked)

    def only_locks_close(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> bool:
        """Return whether there is a way that :meth:`find` would find if hosts unlocked what they locked."""
        try:
            self._find(self._any_day, start, destinations, vehicle=vehicle, avoid=avoid)
        except NoRouteError:
            return False
        return True

    def find(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> RoutePlan:
        """Find the cheapest way from the point ``start``.

        Raises:
            NoRouteError: some destination cannot be reached from the one before.

        """
        with self.planning.timed():
            return self._find(self.router, start, destinations, vehicle=vehicle, avoid=avoid)

    def _find(
        self,
        router: Router,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> RoutePlan:
        legs: list[Leg] = []
        for free, group in groupby(destinations, lambda each: each.coordinate is not None):
            if free:
                for coordinate in (each.coordinate for each in group if each.coordinate):
                    legs.append(Leg(_distance_mm(self._plant.point(start), coordinate)))
                    start = self.nearest(coordinate)
            else:
                choices = [access_points(each, self._plant) for each in group]
                routes = router.route_through(start, choices, vehicle=vehicle, avoid=avoid)
                legs.extend(Leg(route.cost, route) for route in routes)
                start = routes[-1].destination
        return RoutePlan(tuple(legs))

    def nearest(self, coordinate: Coordinate) -> str:
        """Return the point at which a route continues after a coordinate."""
        return min(self._plant.points, key=lambda point: _distance_mm(point, coordinate)).name

    def why_unroutable(self, destinations: Sequence[Destination], avoid: Collection[str]) -> str | None:
        """Return why no vehicle could execute this from any start; None if one could.

        As in openTCS, each access point of the first destination is tried as a start.
        """
        first = destinations[0]
        starts = (self.nearest(first.coordinate),) if first.coordinate else access_points(first, self._plant)
        reason = "The first destination has no access point."
        for start in starts:
            try:
                self._find(self._any_day, start, destinations, avoid=avoid)
            except NoRouteError as error:
                reason = str(error)
            else:
                return None
        return reason


def _distance_mm(point: Point, coordinate: Coordinate) -> float:
    return hypot(point.x_m - coordinate.x, point.y_m - coordinate.y) * MM_PER_M


class RouteCost(NamedTuple):
    """What a way costs in the router's unit; infinity where there is none."""

    complete: float
    """All of it."""
    initial: float
    """To the first destination."""


NO_WAY = RouteCost(inf, inf)


@dataclass(frozen=True, slots=True)
class _Entry:
    """One point at which the first destination can be served, and what the rest costs from there."""

    to_it: CostMap
    rest: float


@dataclass(frozen=True, slots=True)
class OrderCosts:
    """The costs of one order for vehicles of one routing profile, wherever they start."""

    entries: tuple[_Entry, ...]

    def source(self, point: str) -> RouteCost:
        """Return the cost for a vehicle that starts at ``point``."""
        best = NO_WAY
        for entry in self.entries:
            initial = entry.to_it.source(point)
            best = min(best, RouteCost(initial + entry.rest, initial))
        return best


class RouteCosts:
    """Returns costs of routes in one plant; routes to coordinates are searched one by one."""

    def __init__(self, plant: PlantModel, finder: RouteFinder) -> None:
        self._plant = plant
        self._finder = finder

    def cost(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None,
        avoid: Collection[str] = frozenset(),
    ) -> RouteCost:
        """Return the cost of a way as :meth:`RouteFinder.find` would find it."""
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
        """Return the costs of an order without coordinates, computed from its end."""
        entries: tuple[_Entry, ...] = ()
        later: OrderCosts | None = None
        for destination in reversed(destinations):
            entries = tuple(
                _Entry(
                    self._finder.router.costs_to(point, vehicle=vehicle, avoid=avoid),
                    later.source(point).complete if later else 0.0,
                )
                for point in access_points(destination, self._plant)
            )
            later = OrderCosts(entries)
        return OrderCosts(entries)

    def _searched(
        self, start: str, destinations: Sequence[Destination], vehicle: Vehicle | None, avoid: Collection[str]
    ) -> RouteCost:
        try:
            way = self._finder.find(start, destinations, vehicle=vehicle, avoid=avoid)
        except NoRouteError:
            return NO_WAY
        return RouteCost(way.cost, way.legs[0].cost)


ROUTES_KEPT = 2_000
"""Routes that are remembered, of a few kB each; a request that waits asks for the same one each time."""


class VehicleRoutes:
    """Finds and caches routes that respect the plant model's data of each vehicle."""

    def __init__(self, router: Router, model_of: Callable[[str], Vehicle | None]) -> None:
        """``model_of`` returns the plant model's data of the vehicle of this name; None if it has none."""
        self._router = router
        self._model_of = model_of
        self._route = lru_cache(ROUTES_KEPT)(self._find)

    def route(
        self,
        vehicle: str,
        start: str,
        goal: str,
        *,
        avoid: Collection[str] = frozenset(),
        burden: Mapping[str, float] | None = None,
    ) -> Route:
        """Return the cheapest route; raises NoRouteError. One with a ``burden`` is not remembered."""
        if burden:
            model = self._model_of(vehicle)
            return self._router.route(start, goal, vehicle=model, avoid=avoid, burden=burden)
        found = self._route(self._model(vehicle), start, goal, frozenset(avoid))
        if isinstance(found, NoRouteError):
            raise found.with_traceback(None)
        return found

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Return what it costs to reach each point that can be reached."""
        return self._router.costs_from(start, vehicle=self._model_of(vehicle))

    def forget(self) -> None:
        """Forget all routes: the plant has changed."""
        self._route.cache_clear()

    def _model(self, vehicle: str) -> str | None:
        return vehicle if self._model_of(vehicle) else None

    def _find(
        self, vehicle: str | None, start: str, goal: str, avoid: frozenset[str]
    ) -> Route | NoRouteError:
        """Return what is remembered: that there is no way costs as much to find out as one."""
        model = self._model_of(vehicle) if vehicle else None
        try:
            return self._router.route(start, goal, vehicle=model, avoid=avoid)
        except NoRouteError as error:
            return error
