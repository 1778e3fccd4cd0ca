"""The router: the cheapest ways through a plant. Other vehicles, blocks and queues do not influence it."""

from collections.abc import Collection, Mapping, Sequence
from itertools import chain, pairwise
from typing import NamedTuple

from nena_order_service.routing.costs import CostEvaluator, distance
from nena_order_service.routing.errors import NoRouteError
from nena_order_service.routing.graph import Avoided, RoutingGraph
from nena_order_service.routing.profile import RoutingProfile
from nena_order_service.routing.route import Route
from nena_shared.plant import ObjectKind, PlantModel, UnknownObjectError, Vehicle


class Router:
    """Finds routes over one plant model; for a changed model make a new router.

    The cost of an edge is the sum of the chosen evaluators, by default the length in mm.
    """

    def __init__(self, plant: PlantModel, costs: Sequence[CostEvaluator] = (distance,)) -> None:
        self._plant = plant
        self._costs = tuple(costs)
        # As many as there are kinds of vehicle.
        self._graphs: dict[RoutingProfile, RoutingGraph] = {}

    def route(
        self,
        source: str,
        destination: str,
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> Route:
        """Return the cheapest route between two points.

        `avoid` names points, paths and locations (which stand for their linked points) that must not be used.
        Raises UnknownObjectError for a name that the plant does not have and NoRouteError if there is no way.
        """
        self._check_points((source, destination))
        steps = self._graph(vehicle).shortest(source, destination, self._avoided(avoid))
        if steps is None:
            raise NoRouteError(source, (destination,), vehicle, avoid)
        return Route(source, destination, steps)

    def route_through(
        self,
        source: str,
        destinations: Sequence[Collection[str]],
        *,
        vehicle: Vehicle | None = None,
        avoid: Collection[str] = frozenset(),
    ) -> tuple[Route, ...]:
        """Return one route for each destination, one after the other, with the lowest cost in all.

        Each destination is a choice of points, such as the access points of a location. The choice that is
        cheapest for the whole way is taken, even if another point would have been nearer at first. Raises as
        `route` does; NoRouteError names the first destination that cannot be reached.
        """
        self._check_points([source, *chain.from_iterable(destinations)])
        graph, avoided = self._graph(vehicle), self._avoided(avoid)
        ways = {source: _Way(0.0, (source,))}
        for choice in destinations:
            longer = _longer(graph, ways, choice, avoided)
            if not longer:
                raise NoRouteError(next(iter(ways)), choice, vehicle, avoid)
            ways = longer
        points = min(ways.values()).points
        return tuple(self.route(start, end, vehicle=vehicle, avoid=avoid) for start, end in pairwise(points))

    def _graph(self, vehicle: Vehicle | None) -> RoutingGraph:
        profile = RoutingProfile.of(vehicle)
        if profile not in self._graphs:
            self._graphs[profile] = RoutingGraph(self._plant, self._costs, profile)
        return self._graphs[profile]

    def _check_points(self, names: Collection[str]) -> None:
        for name in names:
            self._plant.point(name)

    def _avoided(self, names: Collection[str]) -> Avoided:
        points: set[str] = set()
        paths: set[str] = set()
        for name in names:
            if name in self._plant.points_by_name:
                points.add(name)
            elif name in self._plant.paths_by_name:
                paths.add(name)
            elif name in self._plant.locations_by_name:
                points.update(link.point for link in self._plant.location(name).links)
            else:
                raise UnknownObjectError(ObjectKind.POINT, name, self._plant.points_by_name)
        return Avoided(frozenset(points), frozenset(paths))


class _Way(NamedTuple):
    """The points chosen so far, one for each destination, and the least cost of driving through them."""

    cost: float
    points: tuple[str, ...]


def _longer(
    graph: RoutingGraph, ways: Mapping[str, _Way], choice: Collection[str], avoided: Avoided
) -> dict[str, _Way]:
    """Return the cheapest way to each reachable point of the choice, given the cheapest ways so far."""
    longer: dict[str, _Way] = {}
    for start, way in ways.items():
        for point, cost in graph.costs_from(start, choice, avoided).items():
            candidate = _Way(way.cost + cost, (*way.points, point))
            longer[point] = min(candidate, longer.get(point, candidate))
    return longer
