"""Evasion: where a vehicle that rests in the way of another one can go."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from nena_order_service.routing import Route
from nena_order_service.traffic.resources import Resources, ResourceSet, conflict
from nena_order_service.traffic.scheduler import Hindrance, Scheduler
from nena_order_service.traffic.ways import Ways
from nena_shared.plant import PlantModel
from nena_shared.plant.point import PointType

CANDIDATES_TRIED = 8
"""Places looked at for one vehicle; what is farther away is hardly better."""


@dataclass(frozen=True, slots=True)
class Evasion:
    """A vehicle's way out of the way; it is claimed already."""

    vehicle: str
    route: Route
    way: tuple[ResourceSet, ...]


class Evader:
    """Finds places where vehicles that rest can wait without being in the way."""

    def __init__(self, plant: PlantModel, resources: Resources, scheduler: Scheduler, ways: Ways) -> None:
        self._plant = plant
        self._resources = resources
        self._scheduler = scheduler
        self._ways = ways

    def evade(
        self, blockers: Iterable[str], kept_free: Iterable[ResourceSet], movable: Callable[[str], bool]
    ) -> Iterator[Evasion]:
        """Send those of the ``blockers`` that can go to places outside of ``kept_free``.

        A blocker that is itself enclosed by vehicles at rest has these go first, and goes when it is asked
        for again.
        """
        asked: set[str] = set()
        yield from self._evade(blockers, list(kept_free), movable, asked)

    def _evade(
        self,
        blockers: Iterable[str],
        kept_free: list[ResourceSet],
        movable: Callable[[str], bool],
        asked: set[str],
    ) -> Iterator[Evasion]:
        for vehicle in blockers:
            if vehicle in asked or not movable(vehicle):
                continue
            asked.add(vehicle)
            enclosed: tuple[tuple[str, ...], list[ResourceSet]] | None = None
            for route, sets in self._ways_out(vehicle, kept_free):
                refusal = self._scheduler.claim(vehicle, sets)
                if refusal is None:
                    yield Evasion(vehicle, route, tuple(sets))
                    break
                if refusal.hindrance is Hindrance.RESTING and enclosed is None:
                    enclosed = refusal.vehicles, sets
            else:
                if enclosed:
                    yield from self._evade(enclosed[0], [*kept_free, *enclosed[1]], movable, asked)

    def _ways_out(
        self, vehicle: str, kept_free: list[ResourceSet]
    ) -> Iterator[tuple[Route, list[ResourceSet]]]:
        """Give ways to free places, the best first: where vehicles park, then near ones."""
        occupant = self._scheduler.occupant(vehicle)
        costs = self._ways.costs(vehicle, occupant.point)
        kept = {resource for each in kept_free for resource in each.uses} | {occupant.point}
        free = (name for name in costs if name not in kept and not self._scheduler.users(name))
        tried = 0
        for place in sorted(free, key=lambda name: (not self._parks(name), costs[name])):
            route = self._ways.route(vehicle, occupant.point, place)
            sets = self._resources.way(route.steps, start=occupant.held[-1], entry=occupant.entry)
            if not overlap(self._scheduler.end_of(vehicle, sets), kept_free):
                yield route, sets
                tried += 1
                if tried == CANDIDATES_TRIED:
                    return

    def _parks(self, point: str) -> bool:
        return self._plant.point(point).type is PointType.PARK_POSITION


def overlap(some: Iterable[ResourceSet], others: Iterable[ResourceSet]) -> str | None:
    """Give a resource that two vehicles with these sets would both need; None: there is none."""
    uses: dict[str, set[str | None]] = {}
    for each in others:
        for resource, direction in each.uses.items():
            uses.setdefault(resource, set()).add(direction)
    for each in some:
        for resource, direction in each.uses.items():
            if any(conflict(direction, other) for other in uses.get(resource, ())):
                return resource
    return None
