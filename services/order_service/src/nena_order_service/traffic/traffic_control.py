"""Who may begin a route now, who must make room, and in which order vehicles pass (decision 0021)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from math import inf
from typing import Protocol

from nena_order_service.routing import NoRouteError, Route
from nena_order_service.traffic.resources import Occupant, Resources, ResourceSet, UseIndex, conflict
from nena_shared.plant import PlantModel
from nena_shared.plant.track import PointType


class Routes(Protocol):
    """Gives the ways of vehicles, which it knows by name, between points of the plant."""

    def route(self, vehicle: str, start: str, goal: str, *, avoid: Collection[str] = frozenset()) -> Route:
        """Return the cheapest way; raises NoRouteError."""
        ...

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Return what it costs to reach each point that can be reached from ``start``."""
        ...


class WaitReason(Enum):
    """Why resources are not granted."""

    HELD = auto()
    """Others hold them, and will go on."""
    RESTING = auto()
    """Others rest on them."""
    ORDER = auto()
    """Others must go first, or the vehicles would block each other."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a vehicle must wait, and for whom."""

    hindrance: WaitReason
    vehicles: tuple[str, ...]
    resource: str

    def __str__(self) -> str:
        names = ", ".join(self.vehicles)
        match self.hindrance:
            case WaitReason.HELD:
                return f"waits for {self.resource!r}, which {names} holds"
            case WaitReason.RESTING:
                return f"waits for {self.resource!r}, where {names} rests"
            case WaitReason.ORDER:
                return f"lets {names} go first at {self.resource!r}"


class UnknownOccupantError(LookupError):
    """Traffic control has not been told where the vehicle ``name`` is."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"place vehicle {name!r} before anything is claimed for it")


class Scheduler:
    """Who holds, claims and will rest on what; names of vehicles and of resources are the plant's."""

    def __init__(self) -> None:
        self._occupants: dict[str, Occupant] = {}
        self._holds = UseIndex()
        self._claims = UseIndex()
        self._ends = UseIndex()
        self._rests: dict[str, list[ResourceSet]] = {}

    def occupant(self, name: str) -> Occupant:
        """Return a vehicle as it stands, to be read; raises UnknownOccupantError."""
        try:
            return self._occupants[name]
        except KeyError:
            raise UnknownOccupantError(name) from None

    def __contains__(self, name: str) -> bool:
        return name in self._occupants

    @property
    def names(self) -> tuple[str, ...]:
        """The vehicles that are known."""
        return tuple(self._occupants)

    def place(
        self, name: str, place: Iterable[ResourceSet], length_mm: int, *, entry: ResourceSet | None = None
    ) -> None:
        """Handle a vehicle that rests on ``place``, oldest set first, whoever else is there.

        ``entry`` is what it needs to come to the point of the last set, where it is not there yet.
        """
        self.remove(name)
        sets = deque(place)
        self._occupants[name] = Occupant(name, length_mm, sets, reached=len(sets) - 1, entry=entry)
        for each in sets:
            self._holds.add(name, each.uses)

    def remove(self, name: str) -> None:
        """Forget a vehicle and free what it holds; one that is not known stays so."""
        if name not in self._occupants:
            return
        self.give_up_claim(name)
        self._forget_end(name)
        for each in self._occupants.pop(name).held:
            self._holds.remove(name, each.uses)

    def claim(self, name: str, way: Sequence[ResourceSet]) -> Refusal | None:
        """Claim a way that follows what the vehicle holds; gives why not, and then nothing has changed.

        A claim that is there already is replaced.
        """
        occupant = self.occupant(name)
        if refusal := self._resting_on(name, way):
            return refusal
        before = tuple(occupant.claimed)
        self._set_claim(occupant, way)
        if refusal := self._cycle(name):
            self._set_claim(occupant, before)
        return refusal

    def allocate(self, name: str) -> Refusal | None:
        """Allocate the next claimed set; gives why not, and then nothing has changed.

        Raises:
            LookupError: the vehicle is not known, or claims nothing.

        """
        occupant = self.occupant(name)
        if not occupant.claimed:
            message = f"vehicle {name!r} claims nothing"
            raise LookupError(message)
        wanted = occupant.claimed[0]
        # Somebody may have come to rest on the way since it was claimed, and must be able to get out of it.
        if refusal := self._resting_on(name, occupant.claimed) or self._held(name, wanted):
            return refusal
        if refusal := self._precedence(name, wanted):
            return refusal
        self.seize(name)
        return None

    def resume(self, name: str, held: Sequence[ResourceSet], claimed: Sequence[ResourceSet]) -> None:
        """Let a vehicle that rests hold and claim what it was granted before, unasked."""
        occupant = self.occupant(name)
        for each in held:
            self._holds.add(name, each.uses)
        occupant.held.extend(held)
        self._set_claim(occupant, claimed)

    def seize(self, name: str) -> None:
        """Let a vehicle hold the next set that it claims, unasked: it is there already."""
        occupant = self.occupant(name)
        taken = occupant.claimed.popleft()
        self._claims.remove(name, taken.uses)
        occupant.held.append(taken)
        self._holds.add(name, taken.uses)

    def arrive(self, name: str, index: int) -> bool:
        """Note that the vehicle has come to its ``index``-th held set; tell whether that frees any."""
        occupant = self.occupant(name)
        freed = occupant.arrive(index)
        for each in freed:
            self._holds.remove(name, each.uses)
        if occupant.resting:
            self._forget_end(name)
        return bool(freed)

    def give_up_claim(self, name: str) -> None:
        """Drop what the vehicle claims; what it holds stays with it, for it may still drive there."""
        self._set_claim(self.occupant(name), ())

    def stand(self, name: str) -> None:
        """Note that the vehicle stands for good where it is, and free what it was to drive to.

        It may be anywhere on the way to the next point, so that set stays with it.
        """
        occupant = self.occupant(name)
        self.give_up_claim(name)
        while occupant.ahead > 1:
            self._holds.remove(name, occupant.held.pop().uses)
        occupant.reached = len(occupant.held) - 1
        self._forget_end(name)

    def sharing(self, name: str) -> tuple[str, str] | None:
        """Return another vehicle that holds what this one holds exclusively, and the resource, or None."""
        return next(self._others(self._holds, name, self.occupant(name).held), None)

    def users(self, resource: str) -> frozenset[str]:
        """Return who holds, claims or will rest on ``resource``."""
        return self._holds.users(resource) | self._claims.users(resource) | self._ends.users(resource)

    def resting_on(self, name: str, way: Iterable[ResourceSet]) -> tuple[str, ...]:
        """Return the vehicles that rest where ``name`` would have to pass or to stop."""
        found = (other for other, _ in self._others(self._holds, name, way))
        return tuple(dict.fromkeys(other for other in found if self._occupants[other].resting))

    def rests_or_will_rest_on(self, name: str, way: Iterable[ResourceSet]) -> bool:
        """Return whether others rest where ``name`` would have to pass or to stop, or will at their ends."""
        way = tuple(way)
        return bool(self.resting_on(name, way)) or any(self._others(self._ends, name, way))

    def end_of(self, name: str, way: Sequence[ResourceSet]) -> list[ResourceSet]:
        """Return what the vehicle would rest on at the end of ``way``."""
        return self.occupant(name).at_end(way)

    def _set_claim(self, occupant: Occupant, way: Sequence[ResourceSet]) -> None:
        name = occupant.name
        for each in occupant.claimed:
            self._claims.remove(name, each.uses)
        self._forget_end(name)
        occupant.claimed = deque(way)
        for each in way:
            self._claims.add(name, each.uses)
        if not occupant.resting:
            self._rests[name] = occupant.at_end(way)
            for each in self._rests[name]:
                self._ends.add(name, each.uses)

    def _forget_end(self, name: str) -> None:
        for each in self._rests.pop(name, ()):
            self._ends.remove(name, each.uses)

    def _others(self, index: UseIndex, name: str, sets: Iterable[ResourceSet]) -> Iterator[tuple[str, str]]:
        for each in sets:
            yield from index.others(name, each.uses)

    def _resting_on(self, name: str, way: Iterable[ResourceSet]) -> Refusal | None:
        way = tuple(way)
        for other, resource in self._others(self._holds, name, way):
            if self._occupants[other].resting:
                return Refusal(WaitReason.RESTING, self.resting_on(name, way), resource)
        return None

    def _held(self, name: str, wanted: ResourceSet) -> Refusal | None:
        others = list(self._holds.others(name, wanted.uses))
        if not others:
            return None
        resting = all(self._occupants[other].resting for other, _ in others)
        names = tuple(dict.fromkeys(other for other, _ in others))
        return Refusal(WaitReason.RESTING if resting else WaitReason.HELD, names, others[0][1])

    def _precedence(self, name: str, wanted: ResourceSet) -> Refusal | None:
        """Return who claims ``wanted`` and must go before this vehicle, directly or by others in between."""
        for other, resource in self._claims.others(name, wanted.uses):
            if self._must_precede(other, name):
                return Refusal(WaitReason.ORDER, (other,), resource)
        return None

    def _cycle(self, name: str) -> Refusal | None:
        """Return who must go before this vehicle, directly or by others in between, and also after it."""
        for other, resource in self._later(name):
            if self._must_precede(other, name):
                return Refusal(WaitReason.ORDER, (other,), resource)
        return None

    def _must_precede(self, first: str, later: str) -> bool:
        """Return whether ``first`` must come to its end before ``later`` can come to its own."""
        seen, open_ends = {first}, [first]
        while open_ends:
            for other, _ in self._later(open_ends.pop()):
                if other == later:
                    return True
                if other not in seen:
                    seen.add(other)
                    open_ends.append(other)
        return False

    def _later(self, name: str) -> Iterator[tuple[str, str]]:
        """Yield the vehicles that cannot come to their ends before this one, and for which resource."""
        occupant = self._occupants[name]
        yield from self._others(self._claims, name, occupant.held)
        yield from self._others(self._ends, name, occupant.claimed)


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

    def __init__(self, plant: PlantModel, resources: Resources, scheduler: Scheduler, ways: Routes) -> None:
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
                if refusal.hindrance is WaitReason.RESTING and enclosed is None:
                    enclosed = refusal.vehicles, sets
            else:
                if enclosed:
                    yield from self._evade(enclosed[0], [*kept_free, *enclosed[1]], movable, asked)

    def _ways_out(
        self, vehicle: str, kept_free: list[ResourceSet]
    ) -> Iterator[tuple[Route, list[ResourceSet]]]:
        """Yield ways to free places, the best first: where vehicles park, then near ones."""
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
    """Return a resource that two vehicles with these sets would both need; None: there is none."""
    uses: dict[str, set[str | None]] = {}
    for each in others:
        for resource, direction in each.uses.items():
            uses.setdefault(resource, set()).add(direction)
    for each in some:
        for resource, direction in each.uses.items():
            if any(conflict(direction, other) for other in uses.get(resource, ())):
                return resource
    return None


LONGEST_DETOUR = 1.5
"""How many times the cheapest way a detour around vehicles at rest may cost."""


@dataclass(frozen=True, slots=True)
class RouteRequest:
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
class RouteGrant:
    """A vehicle may begin its way; it is claimed. A straight way has no route."""

    route_request: RouteRequest
    route: Route | None
    way: tuple[ResourceSet, ...]

    @property
    def vehicle(self) -> str:
        """The vehicle that may begin."""
        return self.route_request.vehicle


@dataclass(frozen=True, slots=True)
class RouteRejection:
    """A vehicle's route request is dropped: no route leads to its goal any more."""

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
    """Keeps route requests in the order in which they came, and grants each as soon as it can.

    The oldest request that waits has the right of way: no vehicle comes to rest on its route any more, and
    any that rests there makes room, even with a request of its own. So its turn comes.
    """

    def __init__(self, plant: PlantModel, ways: Routes, resources: Resources | None = None) -> None:
        self.resources = resources or Resources(plant)
        self.scheduler = Scheduler()
        self._ways = ways
        self._drivable = {*plant.points_by_name, *plant.paths_by_name}
        self._evader = Evader(plant, self.resources, self.scheduler, ways)
        self._requests: dict[str, RouteRequest] = {}
        self._refusals: dict[str, Refusal] = {}

    def request_route(self, route_request: RouteRequest, *, first: bool = False) -> None:
        """Handle what a vehicle wants; it replaces what the same vehicle wanted, and keeps its place.

        A vehicle that had its turn, but could not come to its goal, is ``first`` in the row.
        """
        if first:
            self._requests = {route_request.vehicle: route_request, **self._requests}
        self._requests[route_request.vehicle] = route_request

    def drop(self, vehicle: str) -> None:
        """Forget what a vehicle wants."""
        self._requests.pop(vehicle, None)
        self._refusals.pop(vehicle, None)

    @property
    def requesting(self) -> tuple[str, ...]:
        """The vehicles with a route request, oldest first."""
        return tuple(self._requests)

    def why_waiting(self, vehicle: str) -> Refusal | None:
        """Return why the request of a vehicle is not granted yet."""
        return self._refusals.get(vehicle)

    def decide(
        self, movable: Callable[[str], bool], lost: Callable[[str], bool] = nobody
    ) -> Iterator[RouteGrant | Evasion | RouteRejection]:
        """Grant what can be granted, oldest first, and send away who rests in the way.

        ``movable`` tells of a vehicle at rest whether it could drive away now: it does nothing else there.
        ``lost`` tells whether nobody knows when it could: who waits for such a one keeps nobody else from
        anything, and takes a detour of any length.
        """
        senior: _Senior | None = None
        for route_request in tuple(self._requests.values()):
            if not self._may_be_granted(route_request) or not movable(route_request.vehicle):
                continue
            granted = self._grant(route_request, senior, lost)
            if isinstance(granted, RouteGrant | RouteRejection):
                self.drop(route_request.vehicle)
                yield granted
                continue
            refusal, way = granted
            self._refusals[route_request.vehicle] = refusal
            if refusal.hindrance is WaitReason.RESTING and any(map(lost, refusal.vehicles)):
                continue
            senior = senior or _Senior(route_request.vehicle, way)
            if refusal.hindrance is WaitReason.RESTING:
                first = senior.vehicle == route_request.vehicle
                yield from self._make_room(refusal, [*senior.way, *way], movable, first=first)

    def _may_be_granted(self, route_request: RouteRequest) -> bool:
        """Return whether the request still stands, and its vehicle rests."""
        if (
            self._requests.get(route_request.vehicle) is not route_request
            or route_request.vehicle not in self.scheduler
        ):
            return False
        return self.scheduler.occupant(route_request.vehicle).resting

    def displaces(self, route_request: RouteRequest) -> bool:
        """Return whether vehicles at rest, now or soon, would have to make room for this request."""
        try:
            route = self._route(route_request)
        except NoRouteError:
            return False
        way = self._sets(route_request, route)
        if route is None or not self.scheduler.rests_or_will_rest_on(route_request.vehicle, way):
            return False
        detour = self._detour(route_request, way, route.cost * LONGEST_DETOUR)
        return detour is None or self.scheduler.rests_or_will_rest_on(
            route_request.vehicle, self._sets(route_request, detour)
        )

    def clear(
        self, blockers: Sequence[str], way: Sequence[ResourceSet], movable: Callable[[str], bool]
    ) -> Iterator[Evasion]:
        """Send those of the ``blockers`` away who rest on a way that is claimed already."""
        yield from self._evader.evade(blockers, way, movable)

    def _make_room(
        self, refusal: Refusal, kept_free: list[ResourceSet], movable: Callable[[str], bool], *, first: bool
    ) -> Iterator[Evasion]:
        def may_be_sent(vehicle: str) -> bool:
            return movable(vehicle) and (first or vehicle not in self._requests)

        yield from self._evader.evade(refusal.vehicles, kept_free, may_be_sent)

    def _grant(
        self, route_request: RouteRequest, senior: _Senior | None, lost: Callable[[str], bool]
    ) -> RouteGrant | RouteRejection | tuple[Refusal, list[ResourceSet]]:
        """Claim the cheapest way or a detour; else tell why the cheapest one was refused."""
        try:
            route = self._route(route_request)
        except NoRouteError as error:
            return RouteRejection(route_request.vehicle, error)
        way = self._sets(route_request, route)
        refusal = self._claim(route_request, way, senior)
        if refusal is None:
            return RouteGrant(route_request, route, tuple(way))
        if route and refusal.hindrance is WaitReason.RESTING:
            longest = inf if any(map(lost, refusal.vehicles)) else route.cost * LONGEST_DETOUR
            detour = self._detour(route_request, way, longest)
            around = self._sets(route_request, detour) if detour else []
            if detour and self._claim(route_request, around, senior) is None:
                return RouteGrant(route_request, detour, tuple(around))
        return refusal, way

    def _route(self, route_request: RouteRequest, avoid: frozenset[str] = frozenset()) -> Route | None:
        if route_request.straight_mm is not None:
            return None
        start = self.scheduler.occupant(route_request.vehicle).point
        return self._ways.route(
            route_request.vehicle, start, route_request.goal, avoid=route_request.avoid | avoid
        )

    def _claim(
        self, route_request: RouteRequest, way: list[ResourceSet], senior: _Senior | None
    ) -> Refusal | None:
        end = self.scheduler.end_of(route_request.vehicle, way)
        if senior and (resource := overlap(end, senior.way)):
            return Refusal(WaitReason.ORDER, (senior.vehicle,), resource)
        return self.scheduler.claim(route_request.vehicle, way)

    def _detour(self, route_request: RouteRequest, way: list[ResourceSet], longest: float) -> Route | None:
        resting = self.scheduler.resting_on(route_request.vehicle, way)
        held = (each for name in resting for each in self.scheduler.occupant(name).held)
        avoid = {resource for each in held for resource in each.uses if resource in self._drivable}
        try:
            detour = self._route(route_request, frozenset(avoid - {route_request.goal}))
        except NoRouteError:
            return None
        return detour if detour and detour.cost <= longest else None

    def _sets(self, route_request: RouteRequest, route: Route | None) -> list[ResourceSet]:
        occupant = self.scheduler.occupant(route_request.vehicle)
        if route is None:
            return [
                self.resources.on(
                    route_request.goal, (route_request.goal,), length_mm=route_request.straight_mm or 0
                )
            ]
        return self.resources.way(
            route.steps, start=occupant.held[-1], entry=occupant.entry, location=route_request.location
        )
