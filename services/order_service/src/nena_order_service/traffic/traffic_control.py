"""Traffic control: who may begin a way now, and who must make room for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf

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
    """A vehicle that rests wants to drive to ``goal``, and there to use ``location`` if one is named.

    Where ``straight_mm`` is given it drives so far straight, off the paths, to a place that is nearest to
    ``goal``. ``avoid`` names points, paths and locations that its way must not use.
    """

    vehicle: str
    goal: str
    location: str | None = None
    avoid: frozenset[str] = frozenset()
    straight_mm: int | None = None


@dataclass(frozen=True, slots=True)
class Departure:
    """A vehicle may begin its way; it is claimed. A straight way has no route."""

    wish: Wish
    route: Route | None
    way: tuple[ResourceSet, ...]

    @property
    def vehicle(self) -> str:
        """The vehicle that may begin."""
        return self.wish.vehicle


@dataclass(frozen=True, slots=True)
class NoWay:
    """A vehicle's wish is forgotten: no way leads to its goal any more."""

    vehicle: str
    error: NoRouteError


@dataclass(frozen=True, slots=True)
class _Senior:
    """The vehicle that has waited longest, and the way that it waits for."""

    vehicle: str
    way: list[ResourceSet]


def nobody(_vehicle: str) -> bool:
    """Tell of no vehicle that it is so."""
    return False


class TrafficControl:
    """Keeps the wishes in the order in which they came, and grants each as soon as it can.

    The oldest wish that waits has the right of way: nobody comes to rest on its way any more, and who rests
    there already makes room, even with a wish of its own. So its turn comes.
    """

    def __init__(self, plant: PlantModel, ways: Ways, resources: Resources | None = None) -> None:
        self.resources = resources or Resources(plant)
        self.scheduler = Scheduler()
        self._ways = ways
        self._drivable = {*plant.points_by_name, *plant.paths_by_name}
        self._evader = Evader(plant, self.resources, self.scheduler, ways)
        self._wishes: dict[str, Wish] = {}
        self._refusals: dict[str, Refusal] = {}

    def wish(self, wish: Wish, *, first: bool = False) -> None:
        """Take in what a vehicle wants; it replaces what the same vehicle wanted, and keeps its place.

        A vehicle that had its turn, but could not come to its goal, is ``first`` in the row.
        """
        if first:
            self._wishes = {wish.vehicle: wish, **self._wishes}
        self._wishes[wish.vehicle] = wish

    def drop(self, vehicle: str) -> None:
        """Forget what a vehicle wants."""
        self._wishes.pop(vehicle, None)
        self._refusals.pop(vehicle, None)

    @property
    def wishing(self) -> tuple[str, ...]:
        """The vehicles that want something, oldest wish first."""
        return tuple(self._wishes)

    def why_waiting(self, vehicle: str) -> Refusal | None:
        """Say why the wish of a vehicle is not granted yet."""
        return self._refusals.get(vehicle)

    def decide(
        self, movable: Callable[[str], bool], lost: Callable[[str], bool] = nobody
    ) -> Iterator[Departure | Evasion | NoWay]:
        """Grant what can be granted, oldest first, and send away who rests in the way.

        ``movable`` tells of a vehicle at rest whether it could drive away now: it does nothing else there.
        ``lost`` tells whether nobody knows when it could: who waits for such a one keeps nobody else from
        anything, and takes a detour of any length.
        """
        senior: _Senior | None = None
        for wish in tuple(self._wishes.values()):
            if not self._may_be_granted(wish) or not movable(wish.vehicle):
                continue
            granted = self._grant(wish, senior, lost)
            if isinstance(granted, Departure | NoWay):
                self.drop(wish.vehicle)
                yield granted
                continue
            refusal, way = granted
            self._refusals[wish.vehicle] = refusal
            if refusal.hindrance is Hindrance.RESTING and any(map(lost, refusal.vehicles)):
                continue
            senior = senior or _Senior(wish.vehicle, way)
            if refusal.hindrance is Hindrance.RESTING:
                first = senior.vehicle == wish.vehicle
                yield from self._make_room(refusal, [*senior.way, *way], movable, first=first)

    def _may_be_granted(self, wish: Wish) -> bool:
        """Tell whether the wish still stands, and its vehicle rests."""
        if self._wishes.get(wish.vehicle) is not wish or wish.vehicle not in self.scheduler:
            return False
        return self.scheduler.occupant(wish.vehicle).resting

    def displaces(self, wish: Wish) -> bool:
        """Tell whether vehicles that rest, or will, would have to make room for what a vehicle might want."""
        try:
            route = self._route(wish)
        except NoRouteError:
            return False
        way = self._sets(wish, route)
        if route is None or not self.scheduler.rests_or_will_rest_on(wish.vehicle, way):
            return False
        detour = self._detour(wish, way, route.cost * LONGEST_DETOUR)
        return detour is None or self.scheduler.rests_or_will_rest_on(wish.vehicle, self._sets(wish, detour))

    def clear(
        self, blockers: Sequence[str], way: Sequence[ResourceSet], movable: Callable[[str], bool]
    ) -> Iterator[Evasion]:
        """Send those of the ``blockers`` away who rest on a way that is claimed already."""
        yield from self._evader.evade(blockers, way, movable)

    def _make_room(
        self, refusal: Refusal, kept_free: list[ResourceSet], movable: Callable[[str], bool], *, first: bool
    ) -> Iterator[Evasion]:
        def may_be_sent(vehicle: str) -> bool:
            return movable(vehicle) and (first or vehicle not in self._wishes)

        yield from self._evader.evade(refusal.vehicles, kept_free, may_be_sent)

    def _grant(
        self, wish: Wish, senior: _Senior | None, lost: Callable[[str], bool]
    ) -> Departure | NoWay | tuple[Refusal, list[ResourceSet]]:
        """Claim the cheapest way or a detour; else tell why the cheapest one was refused."""
        try:
            route = self._route(wish)
        except NoRouteError as error:
            return NoWay(wish.vehicle, error)
        way = self._sets(wish, route)
        refusal = self._claim(wish, way, senior)
        if refusal is None:
            return Departure(wish, route, tuple(way))
        if route and refusal.hindrance is Hindrance.RESTING:
            longest = inf if any(map(lost, refusal.vehicles)) else route.cost * LONGEST_DETOUR
            detour = self._detour(wish, way, longest)
            around = self._sets(wish, detour) if detour else []
            if detour and self._claim(wish, around, senior) is None:
                return Departure(wish, detour, tuple(around))
        return refusal, way

    def _route(self, wish: Wish, avoid: frozenset[str] = frozenset()) -> Route | None:
        if wish.straight_mm is not None:
            return None
        start = self.scheduler.occupant(wish.vehicle).point
        return self._ways.route(wish.vehicle, start, wish.goal, avoid=wish.avoid | avoid)

    def _claim(self, wish: Wish, way: list[ResourceSet], senior: _Senior | None) -> Refusal | None:
        end = self.scheduler.end_of(wish.vehicle, way)
        if senior and (resource := overlap(end, senior.way)):
            return Refusal(Hindrance.ORDER, (senior.vehicle,), resource)
        return self.scheduler.claim(wish.vehicle, way)

    def _detour(self, wish: Wish, way: list[ResourceSet], longest: float) -> Route | None:
        resting = self.scheduler.resting_on(wish.vehicle, way)
        held = (each for name in resting for each in self.scheduler.occupant(name).held)
        avoid = {resource for each in held for resource in each.uses if resource in self._drivable}
        try:
            detour = self._route(wish, frozenset(avoid - {wish.goal}))
        except NoRouteError:
            return None
        return detour if detour and detour.cost <= longest else None

    def _sets(self, wish: Wish, route: Route | None) -> list[ResourceSet]:
        occupant = self.scheduler.occupant(wish.vehicle)
        if route is None:
            return [self.resources.on(wish.goal, (wish.goal,), length_mm=wish.straight_mm or 0)]
        return self.resources.way(
            route.steps, start=occupant.held[-1], entry=occupant.entry, location=wish.location
        )
