"""Traffic control: who may begin a way now, and who must make room for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from nena_order_service.routing import NoRouteError, Route
from nena_order_service.traffic.evasion import Evader, Evasion, overlap
from nena_order_service.traffic.resources import Resources, ResourceSet
from nena_order_service.traffic.scheduler import Hindrance, Refusal, Scheduler
from nena_order_service.traffic.ways import Ways
from nena_shared.plant import PlantModel

LONGEST_DETOUR = 1.5
"""How many times the cheapest way a detour around vehicles at rest may cost."""


@dataclass(frozen=True, slots=True)
class Wish:
    """A vehicle that rests wants to drive to ``goal``, and there to use ``location`` if one is named."""

    vehicle: str
    goal: str
    location: str | None = None


@dataclass(frozen=True, slots=True)
class Departure:
    """A vehicle may begin its way; it is claimed."""

    vehicle: str
    route: Route


@dataclass(frozen=True, slots=True)
class _Senior:
    """The vehicle that has waited longest, and the way that it waits for."""

    vehicle: str
    way: list[ResourceSet]


class TrafficControl:
    """Keeps the wishes in the order in which they came, and grants each as soon as it can.

    The oldest wish that waits has the right of way: nobody comes to rest on its way any more, and who rests
    there already makes room, even with a wish of its own. So its turn comes.
    """

    def __init__(self, plant: PlantModel, ways: Ways) -> None:
        self.resources = Resources(plant)
        self.scheduler = Scheduler()
        self._ways = ways
        self._evader = Evader(plant, self.resources, self.scheduler, ways)
        self._wishes: dict[str, Wish] = {}
        self._refusals: dict[str, Refusal] = {}

    def wish(self, wish: Wish) -> None:
        """Take in what a vehicle wants; it replaces what the same vehicle wanted, and keeps its place."""
        self._wishes[wish.vehicle] = wish

    def drop(self, vehicle: str) -> None:
        """Forget what a vehicle wants."""
        self._wishes.pop(vehicle, None)
        self._refusals.pop(vehicle, None)

    def why_waiting(self, vehicle: str) -> Refusal | None:
        """Say why the wish of a vehicle is not granted yet."""
        return self._refusals.get(vehicle)

    def decide(self, movable: Callable[[str], bool]) -> Iterator[Departure | Evasion]:
        """Grant what can be granted, oldest first, and send away who rests in the way.

        ``movable`` tells of a vehicle at rest whether it could drive away now: it does nothing else there.
        """
        senior: _Senior | None = None
        for wish in tuple(self._wishes.values()):
            occupant = self.scheduler.occupant(wish.vehicle)
            if not occupant.resting or not movable(wish.vehicle):
                continue
            granted = self._grant(wish, senior)
            if isinstance(granted, Departure):
                self.drop(wish.vehicle)
                yield granted
                continue
            refusal, way = granted
            self._refusals[wish.vehicle] = refusal
            senior = senior or _Senior(wish.vehicle, way)
            if refusal.hindrance is Hindrance.RESTING:
                first = senior.vehicle == wish.vehicle
                yield from self._make_room(refusal, [*senior.way, *way], movable, first=first)

    def _make_room(
        self, refusal: Refusal, kept_free: list[ResourceSet], movable: Callable[[str], bool], *, first: bool
    ) -> Iterator[Evasion]:
        def may_be_sent(vehicle: str) -> bool:
            return movable(vehicle) and (first or vehicle not in self._wishes)

        yield from self._evader.evade(refusal.vehicles, kept_free, may_be_sent)

    def _grant(self, wish: Wish, senior: _Senior | None) -> Departure | tuple[Refusal, list[ResourceSet]]:
        """Claim the cheapest way or a short detour; else tell why the cheapest one was refused."""
        start = self.scheduler.occupant(wish.vehicle).point
        route = self._ways.route(wish.vehicle, start, wish.goal)
        way = self._sets(wish, route)
        refusal = self._claim(wish, way, senior)
        if refusal is None:
            return Departure(wish.vehicle, route)
        detour = self._detour(wish, route, way) if refusal.hindrance is Hindrance.RESTING else None
        if detour and self._claim(wish, self._sets(wish, detour), senior) is None:
            return Departure(wish.vehicle, detour)
        return refusal, way

    def _claim(self, wish: Wish, way: list[ResourceSet], senior: _Senior | None) -> Refusal | None:
        end = self.scheduler.end_of(wish.vehicle, way)
        if senior and (resource := overlap(end, senior.way)):
            return Refusal(Hindrance.ORDER, (senior.vehicle,), resource)
        return self.scheduler.claim(wish.vehicle, way)

    def _detour(self, wish: Wish, route: Route, way: list[ResourceSet]) -> Route | None:
        resting = self.scheduler.resting_on(wish.vehicle, way)
        avoid = {self.scheduler.occupant(each).point for each in resting} - {wish.goal}
        try:
            detour = self._ways.route(wish.vehicle, route.source, wish.goal, avoid=avoid)
        except NoRouteError:
            return None
        return detour if detour.cost <= route.cost * LONGEST_DETOUR else None

    def _sets(self, wish: Wish, route: Route) -> list[ResourceSet]:
        start = self.scheduler.occupant(wish.vehicle).held[-1]
        return list(self.resources.along(route.steps, start=start, location=wish.location))
