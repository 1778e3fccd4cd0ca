"""How vehicles at rest make room for others: which free point each is sent to (decision 0038)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain, filterfalse

from nena_order_service.routing.graph import NoRouteError, Route
from nena_order_service.routing.router import Routes
from nena_order_service.traffic.resources import Resources, ResourceSet, conflict
from nena_order_service.traffic.scheduler import Scheduler, WaitReason
from nena_order_service.traffic.turns import SearchLimit
from nena_shared.plant import PlantModel
from nena_shared.plant.track import PointType

CANDIDATES_TRIED = 8
"""Free points tried for a vehicle that makes room; points farther away are hardly better."""

VehicleTest = Callable[[str], bool]
"""A condition on the vehicle with this name."""


def no_vehicle(_vehicle: str) -> bool:
    """Return False: the condition holds for no vehicle."""
    return False


@dataclass(frozen=True, slots=True)
class Evasion:
    """A vehicle at rest makes room by this route; it is claimed already."""

    vehicle: str
    route: Route
    way: tuple[ResourceSet, ...]
    lets_out: str | None = None
    """A vehicle that was enclosed by this one, and makes room next."""


class Evader:
    """Finds free points for vehicles at rest that have to make room, and claims their routes there.

    Where the ``limit`` of searches ends the search for a vehicle, neither it nor others are sent: the next
    decision goes on with what is cached by then.
    """

    def __init__(
        self,
        plant: PlantModel,
        resources: Resources,
        scheduler: Scheduler,
        routes: Routes,
        limit: SearchLimit | None = None,
    ) -> None:
        self._parks = {each.name for each in plant.points if each.type is PointType.PARK_POSITION}
        self._resources = resources
        self._scheduler = scheduler
        self._routes = routes
        self._limit = limit or SearchLimit(routes)

    def evade(
        self,
        blockers: Iterable[str],
        kept_free: Iterable[ResourceSet],
        movable: VehicleTest,
        enclosing: set[str] | None = None,
    ) -> Iterator[Evasion]:
        """Send those of the ``blockers`` that can go to places outside of ``kept_free``.

        If vehicles at rest enclose a blocker, they go first, and the blocker goes at the next request.
        Those of them that cannot be sent are added to ``enclosing``.
        """
        asked: set[str] = set()
        yield from self._evade(blockers, list(kept_free), movable, asked)
        if enclosing is not None:
            enclosing.update(asked)

    def _evade(
        self,
        blockers: Iterable[str],
        kept_free: list[ResourceSet],
        movable: VehicleTest,
        asked: set[str],
        lets_out: str | None = None,
    ) -> Iterator[Evasion]:
        """Send the blockers away, each once; with ``lets_out`` they are those that enclose that vehicle."""
        for vehicle in blockers:
            if vehicle in asked:
                continue
            if not movable(vehicle):
                if lets_out:
                    asked.add(vehicle)
                continue
            if self._limit.reached:
                return
            asked.add(vehicle)
            enclosed: tuple[tuple[str, ...], list[ResourceSet]] | None = None
            for route, way in self._ways_out(vehicle, kept_free):
                refusal = self._scheduler.claim(vehicle, way)
                if refusal is None:
                    yield Evasion(vehicle, route, tuple(way), lets_out)
                    break
                if refusal.reason is WaitReason.RESTING and enclosed is None:
                    enclosed = refusal.vehicles, way
            else:
                if enclosed and not self._limit.reached:
                    enclosing, way_out = enclosed
                    yield from self._evade(
                        enclosing, [*kept_free, *way_out], movable, asked, lets_out=vehicle
                    )

    def _ways_out(
        self, vehicle: str, kept_free: list[ResourceSet]
    ) -> Iterator[tuple[Route, list[ResourceSet]]]:
        """Yield routes to free points, the best first: parking positions, then near points."""
        occupant = self._scheduler.occupant(vehicle)
        nearest = self._routes.nearest(vehicle, occupant.point)
        parks = self._parks.__contains__
        places = chain(filter(parks, nearest), filterfalse(parks, nearest))
        kept = {resource for each in kept_free for resource in each.uses} | {occupant.point}
        tried = 0
        for place in places:
            if place in kept or self._scheduler.users(place):
                continue
            if not self._limit.permits():
                return
            route = self._routes.route(vehicle, occupant.point, place)
            way = self._way(vehicle, route)
            if around := self._around(vehicle, way, place):
                route, way = around, self._way(vehicle, around)
            if not overlap(self._scheduler.end_of(vehicle, way), kept_free):
                yield route, way
                tried += 1
                if tried == CANDIDATES_TRIED:
                    return

    def _way(self, vehicle: str, route: Route) -> list[ResourceSet]:
        occupant = self._scheduler.occupant(vehicle)
        return self._resources.way(route.steps, start=occupant.held[-1], entry=occupant.entry)

    def _around(self, vehicle: str, way: Sequence[ResourceSet], place: str) -> Route | None:
        """Return a route around the vehicles that rest on ``way``; None if there are none, or no route."""
        resting = self._scheduler.resting_on(vehicle, way)
        if not resting:
            return None
        avoid = {each.point for name in resting for each in self._scheduler.occupant(name).held}
        try:
            start = self._scheduler.occupant(vehicle).point
            return self._routes.route(vehicle, start, place, avoid=avoid - {start, place})
        except NoRouteError:
            return None


def overlap(some: Iterable[ResourceSet], others: Iterable[ResourceSet]) -> str | None:
    """Return a resource that two vehicles with these sets would both need; None if there is none."""
    uses: dict[str, set[str | None]] = {}
    for each in others:
        for resource, direction in each.uses.items():
            uses.setdefault(resource, set()).add(direction)
    for each in some:
        for resource, direction in each.uses.items():
            if any(conflict(direction, other) for other in uses.get(resource, ())):
                return resource
    return None
