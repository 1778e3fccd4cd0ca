"""Find the cheapest routes over the routing graph."""

from collections import OrderedDict
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain, pairwise
from typing import NamedTuple, Protocol

from nena_order_service.routing.graph import (
    CostEvaluator,
    CostMap,
    NoRouteError,
    Route,
    RoutingGraph,
    RoutingProfile,
    Step,
    VehicleKinds,
    distance,
)
from nena_shared.plant import (
    ObjectKind,
    Path,
    PlantModel,
    UnknownObjectError,
    Vehicle,
)

COSTS_KEPT = 2_000_000
"""Costs that are remembered, 8 bytes each: as many maps of costs as fit, whatever the size of the plant."""


class Router:
    """Finds routes over one plant model; for a changed model make a new router.

    The cost of an edge is the sum of the chosen evaluators, by default the length in mm.
    """

    def __init__(self, plant: PlantModel, costs: Sequence[CostEvaluator] = (distance,)) -> None:
        self._plant = plant
        self._costs = tuple(costs)
        # As many as there are kinds of vehicle.
        self._graphs: dict[RoutingProfile, RoutingGraph] = {}
        self._locks: dict[str, bool] = {}
        self._maps: OrderedDict[tuple[int, frozenset[str], str], CostMap] = OrderedDict()
        self._kinds = VehicleKinds(plant.vehicle_types)

    def set_locks(self, locks: Mapping[str, bool]) -> None:
        """Lock or unlock paths by name, overriding the plant model; replaces earlier locks."""
        if self._locks == locks:
            return
        before, self._locks = self._locks, dict(locks)
        names = {name for name in {*before, *locks} if before.get(name) is not locks.get(name)}
        changed = [path for path in self._plant.paths if path.name in names]
        for graph in self._graphs.values():
            graph.lock(changed, self._locks)
        self._maps.clear()

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

        `burden` maps edges and points to the share of their cost that is added at present.

        `avoid` names points, paths and locations (which stand for their linked points) that must not be used.
        Raises UnknownObjectError for a name that the plant does not have, NoRouteError if there is no route.
        """
        self._check_points((source, destination))
        steps = self._graph(vehicle, avoid).shortest(source, destination, burden)
        return _found(steps, source, destination, vehicle, avoid)

    def route_through(
        self,
        source: str,
        destinations: Sequence[Collection[str]],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> tuple[Route, ...]:
        """Return one route for each destination, one after the other, with the lowest total cost.

        Each destination is a choice of points, such as the access points of a location. The choice that is
        cheapest for the whole route is taken, even if another point would have been nearer at first. Raises
        as `route` does; NoRouteError names the first destination that cannot be reached.
        """
        self._check_points([source, *chain.from_iterable(destinations)])
        graph = self._graph(vehicle, avoid)
        points = (source, *chain.from_iterable(destinations))
        if any(len(choice) != 1 for choice in destinations):  # else there is nothing to compare
            ways = {source: _Way(0.0, (source,))}
            for choice in destinations:
                longer = _longer(graph, ways, choice)
                if not longer:
                    raise NoRouteError(next(iter(ways)), choice, vehicle, avoid)
                ways = longer
            points = min(ways.values()).points
        return tuple(
            _found(graph.shortest(start, end), start, end, vehicle, avoid) for start, end in pairwise(points)
        )

    def costs_from(self, source: str, *, vehicle: Vehicle | None = None) -> dict[str, float]:
        """Return what it costs to reach each point that can be reached. Raises UnknownObjectError."""
        self._check_points((source,))
        return self._graph(vehicle).costs_from(source, self._plant.points_by_name)

    def costs_to(
        self, destination: str, *, vehicle: Vehicle | None = None, avoid: Collection[str] = frozenset()
    ) -> CostMap:
        """Return what it costs to reach a point from each point; remembered until a path is locked or not.

        Many starts and few goals are compared by this without a search for each. Raises UnknownObjectError.
        """
        key = (self.kind(vehicle), frozenset(avoid), destination)
        known = self._maps.get(key)
        if known is None:
            self._check_points((destination,))
            known = self._maps[key] = self._graph(vehicle, avoid).costs_to(destination)
            while len(self._maps) * len(self._plant.points) > COSTS_KEPT and len(self._maps) > 1:
                self._maps.popitem(last=False)
        else:
            self._maps.move_to_end(key)
        return known

    def prepare(self, vehicles: Iterable[Vehicle | None]) -> None:
        """Build what the first routes of these vehicles need; takes long in large plants."""
        for vehicle in vehicles:
            for point in self._plant.points[:1]:
                self.costs_to(point.name, vehicle=vehicle)

    def kind(self, vehicle: Vehicle | None) -> int:
        """Return a number for the kind of a vehicle: those of one kind have the same ways."""
        return self._kinds.of(vehicle).number

    def _graph(self, vehicle: Vehicle | None, avoid: Collection[str] = ()) -> RoutingGraph:
        profile = self._kinds.of(vehicle).profile
        if profile not in self._graphs:
            self._graphs[profile] = RoutingGraph(self._plant, self._costs, profile, self._locks)
        graph = self._graphs[profile]
        return graph.without(*self._resources(avoid)) if avoid else graph

    def _check_points(self, names: Iterable[str]) -> None:
        for name in names:
            self._plant.point(name)

    def _resources(self, names: Collection[str]) -> tuple[list[str], list[Path]]:
        """Return the points, including those that locations stand for, and the paths of these names."""
        plant = self._plant
        points = [name for name in names if name in plant.points_by_name]
        paths = [plant.paths_by_name[name] for name in names if name in plant.paths_by_name]
        locations = [plant.locations_by_name[name] for name in names if name in plant.locations_by_name]
        if len(points) + len(paths) + len(locations) < len(names):
            known = {**plant.points_by_name, **plant.paths_by_name, **plant.locations_by_name}
            raise UnknownObjectError(ObjectKind.RESOURCE, min(set(names) - set(known)), known)
        return [*points, *(link.point for location in locations for link in location.links)], paths


class Routes(Protocol):
    """Finds routes of vehicles, by their names, between points of the plant."""

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

        ``burden`` names edges and points that cost more now, each with the share of its cost that is added.
        """
        ...

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Return the cost of each point that can be reached from ``start``."""
        ...


class _Way(NamedTuple):
    """The points chosen so far, one for each destination, and the least cost of driving through them."""

    cost: float
    points: tuple[str, ...]


def _found(
    steps: tuple[Step, ...] | None,
    source: str,
    destination: str,
    vehicle: Vehicle | None,
    avoid: Collection[str],
) -> Route:
    if steps is None:
        raise NoRouteError(source, (destination,), vehicle, avoid)
    return Route(source, destination, steps)


def _longer(graph: RoutingGraph, ways: Mapping[str, _Way], choice: Collection[str]) -> dict[str, _Way]:
    """Return the cheapest route to each reachable point of the choice, given the cheapest routes so far."""
    longer: dict[str, _Way] = {}
    for start, way in ways.items():
        for point, cost in graph.costs_from(start, choice).items():
            candidate = _Way(way.cost + cost, (*way.points, point))
            longer[point] = min(candidate, longer.get(point, candidate))
    return longer
