"""Find the cheapest routes between points, through the destinations of an order, and around traffic."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain, groupby, pairwise
from math import hypot, inf
from typing import NamedTuple

from nena_order_service.routing.graph import (
    CostEvaluator,
    CostMap,
    NoRouteError,
    Route,
    RoutingGraph,
    Step,
    VehicleKinds,
    distance,
)
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import Coordinate, Destination
from nena_shared.histogram import SHORT, Histogram
from nena_shared.plant import (
    ObjectKind,
    Path,
    PlantModel,
    Point,
    UnknownObjectError,
    Vehicle,
)
from nena_shared.plant.model import action_of
from nena_shared.plant.track import MM_PER_M

R = ReasonCode

COSTS_KEPT = 2_000_000
"""Maximum number of cached costs, 8 bytes each, over all cost maps."""


class Router:
    """Finds routes in one plant model; create a new router for a changed model.

    The cost of an edge is the sum of the evaluators' costs, by default its length in mm.
    """

    def __init__(self, plant: PlantModel, costs: Sequence[CostEvaluator] = (distance,)) -> None:
        self._plant = plant
        self._costs = tuple(costs)
        self._graphs: dict[int, RoutingGraph] = {}
        """By the numbers of the kinds of vehicles."""
        self._locks: dict[str, bool] = {}
        self._maps: OrderedDict[tuple[int, frozenset[str], str], CostMap] = OrderedDict()
        self._kinds = VehicleKinds(plant.vehicle_types)

    def set_locks(self, locks: Mapping[str, bool]) -> None:
        """Lock or unlock paths by name, overriding the plant model; replaces earlier locks."""
        if self._locks == locks:
            return
        previous, self._locks = self._locks, dict(locks)
        names = {name for name in {*previous, *locks} if previous.get(name) is not locks.get(name)}
        changed = [path for path in self._plant.paths if path.name in names]
        for graph in self._graphs.values():
            graph.apply_locks(changed, self._locks)
        for key, costs in tuple(self._maps.items()):
            kind, avoid, goal = key
            # Costs with resources to avoid belong to a copy of the graph that is not kept.
            if avoid or not self._graphs[kind].keeps_costs(costs, goal, changed):
                del self._maps[key]

    def route(
        self,
        source: str,
        destination: str,
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
        burden: Mapping[str, float] | None = None,
    ) -> Route:
        """Return the cheapest route between two points.

        ``burden`` maps edges and points to the share of their cost that is currently added. ``avoid`` names
        points, paths and locations (which stand for their linked points) that must not be used.

        Raises:
            UnknownObjectError: the plant has no object of a given name.
            NoRouteError: there is no route.
        """
        self._check_points((source, destination))
        graph = self._graph_for(vehicle, avoid)
        if burden:
            # Traffic only adds to costs, so those without it are an admissible heuristic for A*.
            usual = self.costs_to(destination, vehicle=vehicle)
            steps = graph.shortest_steps_now(source, destination, burden, usual)
        else:
            steps = graph.shortest_steps(source, destination)
        return _route_of_steps(steps, (source, destination), vehicle, avoid, graph)

    def route_through(
        self,
        source: str,
        destinations: Sequence[Collection[str]],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> tuple[Route, ...]:
        """Return consecutive routes to all destinations, with the lowest total cost.

        Each destination is a choice of points, such as the access points of a location. The point that is
        cheapest for the whole route is chosen, even if another one is nearer. Raises the same errors as
        :meth:`route`; NoRouteError names the first destination that cannot be reached.
        """
        self._check_points([source, *chain.from_iterable(destinations)])
        graph = self._graph_for(vehicle, avoid)
        points = (source, *chain.from_iterable(destinations))
        if any(len(choice) != 1 for choice in destinations):  # otherwise there is nothing to compare
            ways = {source: _Way(0.0, (source,))}
            for choice in destinations:
                # All the cheapest ways so far are kept: the nearest access point may lie far from the next.
                longer: dict[str, _Way] = {}
                for start, way in ways.items():
                    for point, cost in graph.costs_from(start, choice).items():
                        candidate = _Way(way.cost + cost, (*way.points, point))
                        longer[point] = min(candidate, longer.get(point, candidate))
                if not longer:
                    raise NoRouteError(next(iter(ways)), choice, vehicle, avoid, graph)
                ways = longer
            points = min(ways.values()).points
        return tuple(
            _route_of_steps(graph.shortest_steps(*ends), ends, vehicle, avoid, graph)
            for ends in pairwise(points)
        )

    def steps_along(
        self, start: str, way: Iterable[tuple[str, Collection[str]]], *, vehicle: Vehicle | None = None
    ) -> tuple[Step, ...] | None:
        """Return the steps to these points in turn; see :meth:`RoutingGraph.steps_along`."""
        return self._graph_for(vehicle).steps_along(start, way)

    def costs_from(self, source: str, *, vehicle: Vehicle | None = None) -> dict[str, float]:
        """Return the cost of each reachable point. Raises UnknownObjectError."""
        self._check_points((source,))
        return self._graph_for(vehicle).costs_from(source, self._plant.points_by_name)

    def costs_to(
        self, destination: str, *, vehicle: Vehicle | None = None, avoid: Collection[str] = frozenset()
    ) -> CostMap:
        """Return the costs to reach a point from each point; cached until a path lock changes them.

        This compares many starts and few goals without a search for each. Raises UnknownObjectError.
        """
        key = (self.kind_of(vehicle), frozenset(avoid), destination)
        costs = self._maps.get(key)
        if costs is None:
            self._check_points((destination,))
            costs = self._maps[key] = self._graph_for(vehicle, avoid).costs_to(destination)
            while len(self._maps) * len(self._plant.points) > COSTS_KEPT and len(self._maps) > 1:
                self._maps.popitem(last=False)
        else:
            self._maps.move_to_end(key)
        return costs

    def prepare(self, vehicles: Iterable[Vehicle | None]) -> None:
        """Build the routing graphs for these vehicles in advance, which takes long in large plants."""
        for vehicle in vehicles:
            for point in self._plant.points[:1]:
                self.costs_to(point.name, vehicle=vehicle)

    def kind_of(self, vehicle: Vehicle | None) -> int:
        """Return a number for the kind of a vehicle; vehicles of one kind have the same routes."""
        return self._kinds.kind_of(vehicle).number

    def types_of(self, vehicle: Vehicle | None) -> frozenset[str]:
        """Return the possible types of a vehicle, as far as they affect its routes."""
        return self._kinds.kind_of(vehicle).profile.vehicle_types

    def _graph_for(self, vehicle: Vehicle | None, avoid: Collection[str] = ()) -> RoutingGraph:
        kind = self._kinds.kind_of(vehicle)
        graph = self._graphs.get(kind.number)
        if graph is None:
            graph = RoutingGraph(self._plant, self._costs, kind.profile, self._locks)
            self._graphs[kind.number] = graph
        return graph.without(*self._points_and_paths(avoid)) if avoid else graph

    def _check_points(self, names: Iterable[str]) -> None:
        for name in names:
            self._plant.point(name)

    def _points_and_paths(self, names: Collection[str]) -> tuple[list[str], list[Path]]:
        """Return the points and paths of these names; locations stand for their linked points."""
        plant = self._plant
        points = [name for name in names if name in plant.points_by_name]
        paths = [plant.paths_by_name[name] for name in names if name in plant.paths_by_name]
        locations = [plant.locations_by_name[name] for name in names if name in plant.locations_by_name]
        if len(points) + len(paths) + len(locations) < len(names):
            objects = {**plant.points_by_name, **plant.paths_by_name, **plant.locations_by_name}
            raise UnknownObjectError(ObjectKind.RESOURCE, min(set(names) - set(objects)), objects)
        return [*points, *(link.point for location in locations for link in location.links)], paths


class _Way(NamedTuple):
    """The points chosen so far, one for each destination, and the lowest cost of driving through them."""

    cost: float
    points: tuple[str, ...]


def _route_of_steps(
    steps: tuple[Step, ...] | None,
    ends: tuple[str, str],
    vehicle: Vehicle | None,
    avoid: Collection[str],
    graph: RoutingGraph,
) -> Route:
    if steps is None:
        raise NoRouteError(ends[0], ends[1:], vehicle, avoid, graph)
    return Route(*ends, steps)


@dataclass(frozen=True, slots=True)
class Leg:
    """The leg of one drive order: along a route or, without one, straight to its coordinate."""

    cost: float
    """In the router's unit; in mm for a leg to a coordinate."""
    route: Route | None = None

    @property
    def points(self) -> tuple[str, ...]:
        """The names of all points of the leg, including both ends; empty for a coordinate."""
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
    """Return the points at which a destination other than a coordinate can be served."""
    name = destination.location_name or ""
    return plant.access_points(name, destination.operation) if name in plant.locations_by_name else (name,)


UNROUTABLE_KEPT = 1000
"""Maximum number of destinations of orders known to be routable or not; hosts mostly repeat a few."""


class RouteFinder:
    """Finds routes in one plant: along paths to points and locations, straight to coordinates.

    From a coordinate, the route continues at the nearest point.
    """

    def __init__(
        self,
        plant: PlantModel,
        router: Router,
        without_host_locks: Router | None = None,
        *,
        action_type: Callable[[str], str] = action_of,
    ) -> None:
        """Use a router; ``without_host_locks`` is a second one that ignores the locks set by hosts.

        ``action_type`` returns the VDA 5050 action type of an operation; layouts may forbid it at points.
        """
        self._action_type = action_type
        self._plant = plant
        self.router = router
        self._without_host_locks = without_host_locks or router
        self._locks: Mapping[str, bool] = {}
        self.lock_changes = 0
        """How often locks have been set: what was found with earlier ones may no longer hold."""
        self._unroutable: dict[tuple[object, frozenset[str]], Reason | None] = {}
        """By destinations and resources to avoid: why no vehicle could reach them; None: one could."""
        self.planning = Histogram(SHORT)
        """Duration of :meth:`find`."""

    def set_locks(self, locks: Mapping[str, bool], closed: Collection[str] = ()) -> None:
        """Lock or unlock paths by name, overriding the plant model; those in ``closed`` are locked anyway.

        Such a lock closes routes for now, but makes no order permanently unroutable.
        """
        # As in openTCS, a lock set by a host closes a path for now; an order is not dismissed for it.
        self._without_host_locks.set_locks({path: locked for path, locked in locks.items() if not locked})
        self._unroutable.clear()
        self.lock_changes += 1
        self._locks = {**locks, **dict.fromkeys(closed, True)}
        self.router.set_locks(self._locks)

    def prepare(self, vehicles: Iterable[Vehicle | None]) -> None:
        """Build the routing graphs for these vehicles, and for unspecified ones, in advance."""
        each_kind = {self.router.kind_of(vehicle): vehicle for vehicle in (None, *vehicles)}
        self.router.prepare(each_kind.values())
        self._without_host_locks.prepare((None,))

    def is_locked(self, path: str) -> bool:
        """Return whether new routes avoid a path; unknown paths are not locked."""
        in_plant = self._plant.paths_by_name.get(path)
        return in_plant is not None and self._locks.get(path, in_plant.locked)

    def locks_on_way(
        self, start: str, destinations: Sequence[Destination], vehicle: Vehicle | None, avoid: Collection[str]
    ) -> tuple[str, ...]:
        """Return the locked paths on the route that there would be without the locks set by hosts."""
        try:
            plan = self._find_plan(self._without_host_locks, start, destinations, vehicle, avoid)
        except NoRouteError:
            return ()
        steps = (step for leg in plan.legs if leg.route for step in leg.route.steps)
        return tuple(step.path.name for step in steps if self.is_locked(step.path.name))

    def find(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> RoutePlan:
        """Find the cheapest route from the point ``start``.

        Raises:
            NoRouteError: a destination cannot be reached from the previous one.
        """
        with self.planning.timed():
            return self._find_plan(self.router, start, destinations, vehicle, avoid)

    def _find_plan(
        self,
        router: Router,
        start: str,
        destinations: Sequence[Destination],
        vehicle: Vehicle | None,
        avoid: Collection[str],
    ) -> RoutePlan:
        legs: list[Leg] = []
        for is_coordinate, group in groupby(destinations, lambda stop: stop.coordinate is not None):
            if is_coordinate:
                # No path leads to a coordinate: the robot drives there and on from it straight.
                for coordinate in (stop.coordinate for stop in group if stop.coordinate):
                    legs.append(Leg(_distance_mm(self._plant.point(start), coordinate)))
                    start = self.nearest_point(coordinate)
            else:
                choices = [self.access_points(stop, vehicle) for stop in group]
                routes = router.route_through(start, choices, vehicle=vehicle, avoid=avoid)
                legs.extend(Leg(route.cost, route) for route in routes)
                start = routes[-1].destination
        return RoutePlan(tuple(legs))

    def access_points(self, destination: Destination, vehicle: Vehicle | None) -> tuple[str, ...]:
        """Return the points at which a vehicle can serve a destination other than a coordinate.

        Points where the layout forbids the action to one of the vehicle's possible types are left out.
        """
        points = access_points(destination, self._plant)
        types = self.router.types_of(vehicle)
        if not types:
            return points
        action_type = self._action_type(destination.operation)
        points_by_name = self._plant.points_by_name
        return tuple(
            name
            for name in points
            if name not in points_by_name or not points_by_name[name].forbids(action_type, types)
        )

    def nearest_point(self, coordinate: Coordinate) -> str:
        """Return the point at which a route continues after a coordinate."""
        return min(self._plant.points, key=lambda point: _distance_mm(point, coordinate)).name

    def why_unroutable(self, destinations: Sequence[Destination], avoid: Collection[str]) -> Reason | None:
        """Return why no vehicle could reach these destinations from any start; None if one could.

        As in openTCS, each access point of the first destination is tried as a start.
        """
        if any(destination.coordinate for destination in destinations):  # hosts seldom repeat one
            return self._why_unroutable(destinations, avoid)
        key = (
            tuple([(destination.location_name, destination.operation) for destination in destinations]),
            frozenset(avoid),
        )
        if key not in self._unroutable:
            if len(self._unroutable) >= UNROUTABLE_KEPT:
                self._unroutable.clear()
            self._unroutable[key] = self._why_unroutable(destinations, avoid)
        return self._unroutable[key]

    def _why_unroutable(self, destinations: Sequence[Destination], avoid: Collection[str]) -> Reason | None:
        first = destinations[0]
        starts = (
            (self.nearest_point(first.coordinate),) if first.coordinate else access_points(first, self._plant)
        )
        reason = Reason(R.NO_ACCESS_POINT)
        for start in starts:
            try:
                self._find_plan(self._without_host_locks, start, destinations, None, avoid)
            except NoRouteError as error:
                reason = error.reason
            else:
                return None
        return reason


def _distance_mm(point: Point, coordinate: Coordinate) -> float:
    return hypot(point.x_m - coordinate.x, point.y_m - coordinate.y) * MM_PER_M


class RouteCost(NamedTuple):
    """Costs of a route in the router's unit; infinity if there is none."""

    complete: float
    """Cost of the whole route."""
    initial: float
    """Cost to the first destination."""


NO_ROUTE = RouteCost(inf, inf)


@dataclass(frozen=True, slots=True)
class _Entry:
    """A point at which the first destination can be served, and the remaining cost from there."""

    to_it: CostMap
    rest: float


@dataclass(frozen=True, slots=True)
class OrderCosts:
    """The costs of one order for vehicles of one routing profile, wherever they start."""

    entries: tuple[_Entry, ...]

    def cost_from(self, point: str) -> RouteCost:
        """Return the cost for a vehicle that starts at ``point``."""
        best = NO_ROUTE
        for entry in self.entries:
            initial = entry.to_it.cost_from(point)
            best = min(best, RouteCost(initial + entry.rest, initial))
        return best

    def costs_from_each(self, points: Sequence[str]) -> Sequence[tuple[float, float]]:
        """Return the costs, complete and initial, for vehicles that start at each of many points."""
        rows = [
            [(initial + entry.rest, initial) for initial in entry.to_it.costs_from_each(points)]
            for entry in self.entries
        ]
        if len(rows) == 1:
            return rows[0]
        return [min(costs) for costs in zip(*rows, strict=True)] if rows else [NO_ROUTE] * len(points)


class RouteCosts:
    """Computes the costs of routes in one plant; routes to coordinates are searched one by one."""

    def __init__(self, plant: PlantModel, finder: RouteFinder) -> None:
        self._plant = plant
        self._finder = finder

    def cost_of_route(
        self,
        start: str,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None,
        avoid: Collection[str] = frozenset(),
    ) -> RouteCost:
        """Return the cost of the route that :meth:`RouteFinder.find` would find."""
        if any(destination.coordinate for destination in destinations):
            # No cost map leads to a coordinate: the route is searched, as it will be for the drive.
            try:
                plan = self._finder.find(start, destinations, vehicle=vehicle, avoid=avoid)
            except NoRouteError:
                return NO_ROUTE
            return RouteCost(plan.cost, plan.legs[0].cost)
        return self.costs_of(destinations, vehicle=vehicle, avoid=avoid).cost_from(start)

    def costs_of(
        self,
        destinations: Sequence[Destination],
        *,
        vehicle: Vehicle | None,
        avoid: Collection[str] = frozenset(),
    ) -> OrderCosts:
        """Return the costs of an order without coordinates, computed backwards from its end."""
        entries: tuple[_Entry, ...] = ()
        later: OrderCosts | None = None
        for destination in reversed(destinations):
            entries = tuple(
                _Entry(
                    self._finder.router.costs_to(point, vehicle=vehicle, avoid=avoid),
                    later.cost_from(point).complete if later else 0.0,
                )
                for point in self._finder.access_points(destination, vehicle)
            )
            later = OrderCosts(entries)
        return OrderCosts(entries)


ROUTES_KEPT = 2_000
"""Maximum number of cached routes, a few kB each; a waiting request needs the same one each time."""


PLACES_KEPT = 200
"""Maximum number of starts with cached points, sorted by cost: 8 bytes for each point of the plant."""


class VehicleRoutes:
    """Finds and caches routes of vehicles, by their names; they respect the plant model's data of each."""

    def __init__(self, router: Router, model_of: Callable[[str], Vehicle | None]) -> None:
        """``model_of`` returns the plant model's data of the vehicle of this name; None if it has none."""
        self._router = router
        self._model_of = model_of
        self._route = lru_cache(ROUTES_KEPT)(self._find_plan)
        self._nearest = lru_cache(PLACES_KEPT)(self._sort_places)

    def route(
        self,
        vehicle: str,
        start: str,
        goal: str,
        *,
        avoid: Collection[str] = frozenset(),
        burden: Mapping[str, float] | None = None,
    ) -> Route:
        """Return the cheapest route; raises NoRouteError.

        ``burden`` maps edges and points to the share of their cost that is currently added. A route with a
        burden is not cached.
        """
        if burden:
            model = self._model_of(vehicle)
            return self._router.route(start, goal, vehicle=model, avoid=avoid, burden=burden)
        route = self._route(self._model_name(vehicle), start, goal, frozenset(avoid))
        if isinstance(route, NoRouteError):
            # It is cached: without this, its traceback would grow with each raise and keep the frames alive.
            raise route.with_traceback(None)
        return route

    def steps_along(
        self, vehicle: str, start: str, way: Iterable[tuple[str, Collection[str]]]
    ) -> tuple[Step, ...] | None:
        """Return the steps to these points in turn; see :meth:`RoutingGraph.steps_along`."""
        return self._router.steps_along(start, way, vehicle=self._model_of(vehicle))

    def nearest_points(self, vehicle: str, start: str) -> Sequence[str]:
        """Return the points that can be reached from ``start``, the nearest first."""
        return self._nearest(self._model_name(vehicle), start)

    def forget_routes(self) -> None:
        """Drop all cached routes, because the plant has changed."""
        self._route.cache_clear()
        self._nearest.cache_clear()

    def _model_name(self, vehicle: str) -> str | None:
        return vehicle if self._model_of(vehicle) else None

    def _find_plan(
        self, vehicle: str | None, start: str, goal: str, avoid: frozenset[str]
    ) -> Route | NoRouteError:
        """Return the route, or the error: both are cached, because a failed search costs as much."""
        model = self._model_of(vehicle) if vehicle else None
        try:
            return self._router.route(start, goal, vehicle=model, avoid=avoid)
        except NoRouteError as error:
            return error

    def _sort_places(self, vehicle: str | None, start: str) -> tuple[str, ...]:
        costs = self._router.costs_from(start, vehicle=self._model_of(vehicle) if vehicle else None)
        return tuple(sorted(costs, key=costs.__getitem__))
