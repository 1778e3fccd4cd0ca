"""Relocation: send vehicles at rest to free points, so that others can pass (decision 0038)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, filterfalse

from nena_order_service.routing.graph import NoRouteError, Route
from nena_order_service.routing.router import VehicleRoutes
from nena_order_service.traffic.resources import Resources, ResourceSet, conflict
from nena_order_service.traffic.scheduler import Scheduler, WaitReason
from nena_shared.plant import PlantModel
from nena_shared.plant_terms import PointType

CANDIDATES_TRIED = 8
"""Maximum number of free points tried for a vehicle that is relocated; the nearest ones are the best."""

WAYS_KEPT = 100
"""Maximum number of ways remembered for a vehicle at rest."""

_Way = tuple[Route, list[ResourceSet]]

VehicleTest = Callable[[str], bool]
"""A condition on the vehicle with this name."""


def no_vehicle(_vehicle: str) -> bool:
    """Return False: the condition holds for no vehicle."""
    return False


@dataclass(frozen=True, slots=True)
class Relocation:
    """A vehicle at rest is relocated along this route, which is already claimed."""

    vehicle: str
    route: Route
    way: tuple[ResourceSet, ...]
    lets_out: str | None = None
    """The vehicle that this one enclosed, and that is relocated next."""


class Relocator:
    """Finds free points for vehicles at rest that are in the way, and claims their routes there."""

    def __init__(
        self,
        plant: PlantModel,
        resources: Resources,
        scheduler: Scheduler,
        routes: VehicleRoutes,
    ) -> None:
        self.closed: Sequence[ResourceSet] = ()  # by stopped vehicles and those behind: no way out
        self._parks = {point.name for point in plant.points if point.type is PointType.PARK_POSITION}
        self._resources = resources
        self._scheduler = scheduler
        self._routes = routes
        self._ways: dict[str, tuple[ResourceSet, ResourceSet | None, dict[int, _Way]]] = {}
        """By vehicle: where it rests, and its ways from there by their routes, which are tried very often."""

    def relocate(
        self,
        blockers: Iterable[str],
        kept_free: Sequence[ResourceSet],
        movable: VehicleTest,
        asked: set[str] | None = None,
        *,
        lets_out: str | None = None,
    ) -> Iterator[Relocation]:
        """Send the movable ``blockers``, each at most once, to points outside ``kept_free``.

        Vehicles at rest that enclose a blocker are sent first, and the blocker at the next request: then
        ``lets_out`` names the enclosed one. ``asked`` receives the vehicles that could be sent, and the
        enclosing ones that could not.
        """
        asked = set() if asked is None else asked
        for vehicle in blockers:
            if vehicle in asked:
                continue
            if not movable(vehicle):
                if lets_out:
                    asked.add(vehicle)
                continue
            asked.add(vehicle)
            enclosed: tuple[tuple[str, ...], list[ResourceSet]] | None = None
            for route, way in self._ways_out(vehicle, kept_free):
                refusal = self._scheduler.claim(vehicle, way)
                if refusal is None:
                    yield Relocation(vehicle, route, tuple(way), lets_out)
                    break
                # Only the best way out is cleared: each further one would send more vehicles away.
                if refusal.reason is WaitReason.RESTING and enclosed is None:
                    enclosed = refusal.vehicles, way
            else:
                if enclosed:
                    enclosing, way_out = enclosed
                    kept = [*kept_free, *way_out]
                    yield from self.relocate(enclosing, kept, movable, asked, lets_out=vehicle)

    def _ways_out(
        self, vehicle: str, kept_free: Sequence[ResourceSet]
    ) -> Iterator[tuple[Route, list[ResourceSet]]]:
        """Yield routes to free points, the best first: parking positions, then near points."""
        occupant = self._scheduler.occupant(vehicle)
        nearest = self._routes.nearest_points(vehicle, occupant.point)
        parks = self._parks.__contains__
        places = chain(filter(parks, nearest), filterfalse(parks, nearest))
        kept = {resource for resource_set in kept_free for resource in resource_set.uses} | {occupant.point}
        tried = 0
        for place in places:
            if place in kept or self._scheduler.users_of(place):
                continue
            route = self._routes.route(vehicle, occupant.point, place)
            way = self._resources_of(vehicle, route)
            if around := self._route_around(vehicle, way, place):
                route, way = around, self._resources_of(vehicle, around)
            ends_free = not find_conflict(self._scheduler.end_of(vehicle, way), kept_free)
            if ends_free and not find_conflict(way, self.closed):
                yield route, way
                tried += 1
                if tried == CANDIDATES_TRIED:
                    return

    def _resources_of(self, vehicle: str, route: Route) -> list[ResourceSet]:
        occupant = self._scheduler.occupant(vehicle)
        start, entry = occupant.held[-1], occupant.entry
        known = self._ways.get(vehicle)
        if known is None or known[0] is not start or known[1] is not entry or len(known[2]) == WAYS_KEPT:
            known = self._ways[vehicle] = start, entry, {}
        if id(route) not in known[2]:
            known[2][id(route)] = route, self._resources.for_route(route.steps, start=start, entry=entry)
        return known[2][id(route)][1]

    def _route_around(self, vehicle: str, way: Sequence[ResourceSet], place: str) -> Route | None:
        """Return a route around the vehicles that rest on ``way``; None if there are none, or no route."""
        resting = self._scheduler.resting_on(vehicle, way)
        if not resting:
            return None
        avoid = {
            resource_set.point for name in resting for resource_set in self._scheduler.occupant(name).held
        }
        try:
            start = self._scheduler.occupant(vehicle).point
            return self._routes.route(vehicle, start, place, avoid=avoid - {start, place})
        except NoRouteError:
            return None


def find_conflict(some: Iterable[ResourceSet], others: Iterable[ResourceSet]) -> str | None:
    """Return a resource for which two vehicles with these sets conflict; None if there is none."""
    uses: dict[str, set[str | None]] = {}
    for resource_set in others:
        for resource, direction in resource_set.uses.items():
            uses.setdefault(resource, set()).add(direction)
    for resource_set in some:
        for resource, direction in resource_set.uses.items():
            if any(conflict(direction, direction_there) for direction_there in uses.get(resource, ())):
                return resource
    return None
