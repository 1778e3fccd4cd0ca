"""Routes for requests and for waiting vehicles: the cheapest ones, with traffic added to the costs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from nena_order_service.routing.graph import NoRouteError, Route, burdened_cost
from nena_order_service.routing.router import VehicleRoutes
from nena_order_service.traffic.resources import ResourceSet, opposite_edges
from nena_order_service.traffic.scheduler import Refusal, Scheduler
from nena_shared.plant import PlantModel, UnknownObjectError

CONGESTION = 0.2
"""Share of its cost added to a step for each other vehicle whose route leads to the same point."""
ONCOMING = 0.3
"""Share added for each other vehicle that will drive the path in the opposite direction."""
STANDING = 6.0
"""Share added for each other vehicle that waits at the point, when a waiting vehicle is rerouted."""
WORTH_IT = 0.9
"""Maximum cost of another route for a waiting vehicle, as a share of its current route's cost."""
VEHICLES_PER_SEARCH = 10
"""Traffic is counted again after one route search per this many vehicles under way."""


@dataclass(frozen=True, slots=True)
class RouteRequest:
    """A vehicle at rest wants to drive to ``goal``, and to use the location and devices ``at_goal`` there.

    With ``straight_mm`` it drives straight for this distance, off the paths, to a position near ``goal``.
    ``avoid`` names points, paths and locations that its route must not use.
    """

    vehicle: str
    goal: str
    at_goal: tuple[str, ...] = ()
    avoid: frozenset[str] = frozenset()
    straight_mm: int | None = None


@dataclass(slots=True)
class AllocatedRoute:
    """A vehicle's route: its sets, how many of them are allocated, and how many the vehicle has reached.

    ``released`` of them may be driven; the others are allocated, but wait for a peripheral device.
    """

    way: tuple[ResourceSet, ...]
    allocated: int = 0
    reached: int = 0
    released: int = 0
    refusal: Refusal | None = None
    """Why the next set is not allocated."""
    holds_enough: bool = False
    """Whether the vehicle needs nothing more before it has driven on."""
    route_request: RouteRequest | None = None
    """The request that was granted; None for a relocation, or after a restart."""

    @property
    def all_released(self) -> bool:
        """Whether the vehicle may drive the whole route."""
        return self.released == len(self.way)

    @property
    def all_allocated(self) -> bool:
        """Whether the whole route is allocated."""
        return self.allocated == len(self.way)


class RouteSearch:
    """Finds routes for requests, avoiding traffic; caches each route while its vehicle waits for it."""

    def __init__(
        self,
        plant: PlantModel,
        routes: VehicleRoutes,
        scheduler: Scheduler,
        allocated_routes: Mapping[str, AllocatedRoute],
    ) -> None:
        self._routes = routes
        self._scheduler = scheduler
        self._allocated_routes = allocated_routes
        self._drivable = {*plant.points_by_name, *plant.paths_by_name}
        self._opposite_edges = opposite_edges(plant)
        self._found: dict[str, tuple[tuple[str, RouteRequest], Route]] = {}
        """For each vehicle the start and request of its last search, and the route found."""
        self._burden: dict[str, float] = {}
        self._searched_with_burden = 0

    def find_route(self, route_request: RouteRequest, without: Collection[str] = frozenset()) -> Route | None:
        """Return the cheapest route, None for a straight drive; raises NoRouteError.

        ``without`` names resources that it must not use, in addition to those that the request avoids.
        """
        if route_request.straight_mm is not None:
            return None
        vehicle, goal, avoid = route_request.vehicle, route_request.goal, route_request.avoid
        start = self._scheduler.occupant(vehicle).point
        if not_driven := self._drivable.intersection(without):
            return self._routes.route(vehicle, start, goal, avoid=avoid | not_driven)
        cached = self._found.get(vehicle)
        if cached and cached[0] == (start, route_request):
            return cached[1]
        route = self._routes.route(vehicle, start, goal, avoid=avoid, burden=self._burden_now())
        self._found[vehicle] = (start, route_request), route
        return route

    def find_detour(
        self,
        vehicle: str,
        start: str,
        occupied: Iterable[Iterable[ResourceSet]],
        avoid: Collection[str],
        closed: Collection[str],
        *,
        is_closed: bool = False,
    ) -> Route | None:
        """Return another route from ``start`` for a vehicle under way; None if its current one is as good.

        ``occupied`` is what waiting vehicles hold; ``closed`` resources are avoided like those in ``avoid``.
        ``is_closed``: the current route is none that the vehicle can drive.
        """
        current = self._allocated_routes[vehicle]
        ahead = current.way[current.allocated :]
        shares = defaultdict(float, self._burden_now())
        self._add_burden(shares, current, -1)  # its own traffic is none
        for held in occupied:
            for resource_set in held:
                shares[resource_set.point] += STANDING
        burden = {name: share for name, share in shares.items() if share > 0}
        try:
            without = self._drivable.intersection(closed).union(avoid)
            detour = self._routes.route(vehicle, start, ahead[-1].point, avoid=without, burden=burden)
        except (NoRouteError, UnknownObjectError):  # a new plant model may lack the point
            return None
        present = self._routes.steps_along(
            vehicle, start, ((resource_set.point, resource_set.uses) for resource_set in ahead)
        )
        if present is None or is_closed:
            return detour
        cost = burdened_cost(burden)
        return detour if sum(map(cost, detour.steps)) < WORTH_IT * sum(map(cost, present)) else None

    def forget_route(self, vehicle: str) -> None:
        """Drop the cached route of one vehicle."""
        self._found.pop(vehicle, None)

    def forget_all(self) -> None:
        """Drop all cached routes."""
        self._found.clear()

    def _burden_now(self) -> Mapping[str, float]:
        """Return what traffic adds to costs: to points ahead of vehicles, and to edges towards vehicles."""
        # With many vehicles, one more route changes little, and counting takes as long as they are many.
        if self._searched_with_burden >= len(self._allocated_routes) // VEHICLES_PER_SEARCH:
            burden: defaultdict[str, float] = defaultdict(float)
            for current in self._allocated_routes.values():
                self._add_burden(burden, current, 1)
            self._burden, self._searched_with_burden = burden, 0
        self._searched_with_burden += 1
        return self._burden

    def _add_burden(self, burden: defaultdict[str, float], current: AllocatedRoute, times: int) -> None:
        """Add what one vehicle adds to costs; with ``times`` -1, subtract it."""
        for resource_set in current.way[current.reached :]:
            burden[resource_set.point] += times * CONGESTION
            for use in resource_set.uses:
                for edge in self._opposite_edges.get((use, resource_set.point), ()):
                    burden[edge] += times * ONCOMING
