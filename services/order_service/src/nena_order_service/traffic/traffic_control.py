"""Who may begin a route or continue, and who must make room (decision 0038)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

from nena_order_service.routing.graph import NoRouteError, Route
from nena_order_service.traffic.resources import Resources, ResourceSet, conflict
from nena_order_service.traffic.scheduler import Refusal, Scheduler, WaitReason
from nena_shared.plant import PlantModel
from nena_shared.plant.track import PointType


class Routes(Protocol):
    """Finds routes for vehicles, by their names, between points of the plant."""

    def route(
        self,
        vehicle: str,
        start: str,
        goal: str,
        *,
        avoid: Collection[str] = frozenset(),
        burden: Mapping[str, float] | None = None,
    ) -> Route:
        """Return the cheapest way; raises NoRouteError.

        ``burden`` names edges and points that are dearer now, each with the share of its cost that is added.
        """
        ...

    def costs(self, vehicle: str, start: str) -> Mapping[str, float]:
        """Return what it costs to reach each point that can be reached from ``start``."""
        ...


CANDIDATES_TRIED = 8
"""Places looked at for one vehicle; what is farther away is hardly better."""


@dataclass(frozen=True, slots=True)
class Evasion:
    """A vehicle's way out of the way; it is claimed already."""

    vehicle: str
    route: Route
    way: tuple[ResourceSet, ...]
    lets_out: str | None = None
    """A vehicle that was enclosed by this one, and is to make room next."""


class Evader:
    """Finds places where vehicles that rest can wait without being in the way."""

    def __init__(self, plant: PlantModel, resources: Resources, scheduler: Scheduler, ways: Routes) -> None:
        self._plant = plant
        self._resources = resources
        self._scheduler = scheduler
        self._ways = ways

    def evade(
        self,
        blockers: Iterable[str],
        kept_free: Iterable[ResourceSet],
        movable: Callable[[str], bool],
        enclosing: set[str] | None = None,
    ) -> Iterator[Evasion]:
        """Send those of the ``blockers`` that can go to places outside of ``kept_free``.

        A blocker that is itself enclosed by vehicles at rest makes these go first, and goes on a later call.
        Those that cannot be sent are added to ``enclosing``.
        """
        asked: set[str] = set()
        yield from self._evade(blockers, list(kept_free), movable, asked)
        if enclosing is not None:
            enclosing.update(asked)

    def _evade(
        self,
        blockers: Iterable[str],
        kept_free: list[ResourceSet],
        movable: Callable[[str], bool],
        asked: set[str],
        lets_out: str | None = None,
    ) -> Iterator[Evasion]:
        for vehicle in blockers:
            if vehicle in asked:
                continue
            if not movable(vehicle):
                if lets_out:
                    asked.add(vehicle)
                continue
            asked.add(vehicle)
            enclosed: tuple[tuple[str, ...], list[ResourceSet]] | None = None
            for route, sets in self._ways_out(vehicle, kept_free):
                refusal = self._scheduler.claim(vehicle, sets)
                if refusal is None:
                    yield Evasion(vehicle, route, tuple(sets), lets_out)
                    break
                if refusal.hindrance is WaitReason.RESTING and enclosed is None:
                    enclosed = refusal.vehicles, sets
            else:
                if enclosed:
                    ring = [*kept_free, *enclosed[1]]
                    yield from self._evade(enclosed[0], ring, movable, asked, lets_out=vehicle)

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
            if around := self._around(vehicle, sets, place):
                route = around
                sets = self._resources.way(route.steps, start=occupant.held[-1], entry=occupant.entry)
            if not overlap(self._scheduler.end_of(vehicle, sets), kept_free):
                yield route, sets
                tried += 1
                if tried == CANDIDATES_TRIED:
                    return

    def _around(self, vehicle: str, way: Sequence[ResourceSet], place: str) -> Route | None:
        """Return a route around vehicles resting on the cheapest one; None: no such vehicle, or no route."""
        resting = self._scheduler.resting_on(vehicle, way)
        if not resting:
            return None
        avoid = {each.point for name in resting for each in self._scheduler.occupant(name).held}
        try:
            start = self._scheduler.occupant(vehicle).point
            return self._ways.route(vehicle, start, place, avoid=avoid - {start, place})
        except NoRouteError:
            return None

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
    """A vehicle at rest requests to drive to ``goal`` and to use ``location`` there, if one is named.

    With ``straight_mm`` it drives that far straight, off the paths, to a place that is nearest to ``goal``.
    ``avoid`` names points, paths and locations that its route must not use.
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


CONGESTION = 0.1
"""By which share of its cost a step is dearer for each other vehicle whose way leads to the same point."""

ONCOMING = 0.3
"""By which share a step is dearer for each other vehicle that is to drive the same path the other way."""

BURDEN_KEPT = 10
"""Traffic is counted again after a route for each so many vehicles under way."""

SECTION = 4
"""How many sets a vehicle claims ahead of what it holds; more where it cannot wait there."""


def nobody(_vehicle: str) -> bool:
    """Return False for every vehicle."""
    return False


@dataclass(slots=True)
class Journey:
    """A route under way: its sets, how many of them are allocated, and how many the vehicle has reached."""

    way: tuple[ResourceSet, ...]
    allocated: int = 0
    reached: int = 0
    refusal: Refusal | None = None
    """Why the next set is not allocated."""

    @property
    def all_allocated(self) -> bool:
        """Whether nothing of the way is left to be allocated."""
        return self.allocated == len(self.way)


@dataclass(frozen=True, slots=True)
class Displacement:
    """A vehicle under way blocks an older one.

    Its route ends where it is, so that it can make room.
    """

    vehicle: str


@dataclass(frozen=True, slots=True)
class _RefusedSection:
    """Why a vehicle under way was refused to claim more; so it is until one of these vehicles changes."""

    refused: tuple[Refusal, list[ResourceSet]]
    versions: dict[str, int]


@dataclass(frozen=True, slots=True)
class _LetOut:
    """A vehicle that another one made room for; it rests ``at`` a point in the way of the requester."""

    vehicle: str
    at: str
    requester: str


@dataclass(frozen=True, slots=True)
class MoreClaimed:
    """A vehicle under way claims more of its way than before."""

    vehicle: str


def _oncoming(plant: PlantModel) -> dict[tuple[str, str], list[str]]:
    """Return the edges that lead back, for each path and the point to which it is driven."""
    edges: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for each in plant.edges():
        edges[each.source, each.destination].append(each.id)
    return {
        (each.path.name, each.destination): edges[each.destination, each.source]
        for each in plant.edges()
        if (each.destination, each.source) in edges
    }


class TrafficControl:
    """Grants routes, oldest request first, and each of them section by section.

    A vehicle claims its route as far as :data:`SECTION` sets ahead, to a point where it can wait without
    keeping others from passing it on a two-way track; beyond that its route is only planned. So claims are
    short, vehicles follow each other closely, and a vehicle that stops only stops those behind it.

    The oldest waiting request has the right of way: no vehicle comes to rest on its section any more, and any
    vehicle resting there makes room, even with a request of its own. So every request is granted eventually.
    """

    def __init__(self, plant: PlantModel, ways: Routes, resources: Resources | None = None) -> None:
        self.resources = resources or Resources(plant)
        self.scheduler = Scheduler()
        self.journeys: dict[str, Journey] = {}
        """The vehicles under way."""
        self._ways = ways
        self._drivable = {*plant.points_by_name, *plant.paths_by_name}
        self._evader = Evader(plant, self.resources, self.scheduler, ways)
        self._requests: dict[str, RouteRequest] = {}
        self._refusals: dict[str, Refusal] = {}
        self._oncoming = _oncoming(plant)
        self._routes: dict[str, tuple[tuple[str, RouteRequest], Route]] = {}
        """The routes that vehicles wait for, and for which requests they were found."""
        self._burden: dict[str, float] = {}
        self._burden_age = 0
        """How many routes were searched with this burden."""
        self._refused_sections: dict[str, _RefusedSection] = {}
        self._asked: set[str] = set()
        self._lets_out: dict[str, _LetOut] = {}
        """Vehicles that made room for one which they enclosed."""
        self._turns: dict[str, tuple[int, str]] = {}
        """When the request of each vehicle came and for which goal, also while its way is granted."""
        self._last_turn = 0

    def request_route(self, route_request: RouteRequest, *, first: bool = False) -> None:
        """Queue a vehicle's request; it replaces the vehicle's earlier request, and keeps its place.

        A vehicle that had its turn, but could not reach its goal, keeps that turn; one that is ``first`` and
        had none goes to the front.
        """
        vehicle = route_request.vehicle
        turn, goal = self._turns.get(vehicle, (None, ""))
        if goal != route_request.goal:
            self._lets_out.pop(vehicle, None)
        if first and turn is None:
            turn = min((each for each, _ in self._turns.values()), default=0) - 1
        elif turn is None or not (first or vehicle in self._requests or goal == route_request.goal):
            self._last_turn += 1
            turn = self._last_turn
        self._turns[vehicle] = turn, route_request.goal
        self._requests[vehicle] = route_request

    def drop(self, vehicle: str) -> None:
        """Forget what a vehicle wants."""
        self._requests.pop(vehicle, None)
        self._refusals.pop(vehicle, None)
        self._routes.pop(vehicle, None)

    def end_turn(self, vehicle: str, point: str | None) -> None:
        """End the turn of a vehicle that has arrived at ``point``, if that was its goal."""
        self.forget_refusal(vehicle)
        if vehicle not in self._requests and self._turns.get(vehicle, (0, ""))[1] == point:
            del self._turns[vehicle]

    def forget_refusal(self, vehicle: str) -> None:
        """Forget why a vehicle could not go on; its way has changed or ended."""
        self._refusals.pop(vehicle, None)

    def forget(self, vehicle: str) -> None:
        """Forget a vehicle and its turn."""
        self.drop(vehicle)
        self._turns.pop(vehicle, None)
        self._lets_out.pop(vehicle, None)

    @property
    def requesting(self) -> tuple[str, ...]:
        """The vehicles with a route request, oldest first."""
        return tuple(sorted(self._requests, key=self._turn))

    def _turn(self, vehicle: str) -> int:
        return self._turns.get(vehicle, (0, ""))[0]

    def why_waiting(self, vehicle: str) -> Refusal | None:
        """Return why the request of a vehicle is not granted yet, or no more of its way."""
        return self._refusals.get(vehicle)

    def decide(
        self,
        movable: Callable[[str], bool],
        lost: Callable[[str], bool] = nobody,
        extending: Iterable[str] = (),
    ) -> Iterator[RouteGrant | Evasion | RouteRejection | Displacement | MoreClaimed]:
        """Grant what can be granted, oldest first, and send away vehicles resting in the way.

        ``extending`` names the vehicles under way whose routes are not completely allocated.

        ``movable`` returns whether a vehicle at rest could drive away now. ``lost`` returns whether it is
        unknown when it could: a vehicle that waits for such a one does not hold up others, and takes a detour
        of any length.
        """
        senior: _Senior | None = None
        for vehicle in sorted({*self._requests, *extending}, key=self._turn):
            if vehicle in self.journeys:
                claims = len(self.scheduler.occupant(vehicle).claimed)
                refused = self._go_on(vehicle, senior)
                if len(self.scheduler.occupant(vehicle).claimed) > claims:
                    yield MoreClaimed(vehicle)
            else:
                route_request = self._requests.get(vehicle)
                if not route_request or not self._may_be_granted(route_request) or not movable(vehicle):
                    continue
                granted = self._grant(route_request, senior, lost)
                if isinstance(granted, RouteGrant | RouteRejection):
                    self.drop(vehicle)
                    yield granted
                    continue
                refused = granted
            if refused is None:
                continue
            refusal, way = refused
            self._refusals[vehicle] = refusal
            if refusal.hindrance is WaitReason.RESTING and any(map(lost, refusal.vehicles)):
                continue
            if vehicle in self.journeys and not self.scheduler.occupant(vehicle).resting:
                continue
            senior = senior or _Senior(vehicle, way[: self._next_stop(way)])
            if refusal.hindrance is WaitReason.RESTING:
                first = senior.vehicle == vehicle
                yield from self._make_room(vehicle, refusal, [*senior.way, *way], movable, first=first)

    def _may_be_granted(self, route_request: RouteRequest) -> bool:
        """Return whether the request is still current, and its vehicle rests."""
        if (
            self._requests.get(route_request.vehicle) is not route_request
            or route_request.vehicle not in self.scheduler
        ):
            return False
        return self.scheduler.occupant(route_request.vehicle).resting

    def _go_on(self, vehicle: str, senior: _Senior | None) -> tuple[Refusal, list[ResourceSet]] | None:
        """Claim more of a route under way; if nothing is claimed, return the refusal and what was wanted."""
        journey, claimed = self.journeys[vehicle], len(self.scheduler.occupant(vehicle).claimed)
        ahead = journey.way[journey.allocated :]
        if claimed == len(ahead) or claimed >= SECTION:
            self._refusals.pop(vehicle, None)
            return None
        known = self._refused_sections.get(vehicle)
        if known and known.versions == self.scheduler.versions(known.versions):
            refused: tuple[Refusal, list[ResourceSet]] | None = known.refused
        else:
            self._refused_sections.pop(vehicle, None)
            self._asked = {vehicle}
            refused = self._claim_section(vehicle, ahead, senior, more_than=claimed)
            if refused and (not senior or senior.vehicle not in self._asked):
                self._refused_sections[vehicle] = _RefusedSection(
                    refused, self.scheduler.versions(self._asked)
                )
        if refused is None or claimed:
            self._refusals.pop(vehicle, None)
            return None
        return refused

    def claim_other_way(self, vehicle: str, ahead: Sequence[ResourceSet]) -> Refusal | None:
        """Claim a section of another route from the end of what is held; return the refusal, if any."""
        refused = self._claim_section(vehicle, ahead, None)
        return refused and refused[0]

    def _claim_section(
        self, vehicle: str, ahead: Sequence[ResourceSet], senior: _Senior | None, *, more_than: int = 0
    ) -> tuple[Refusal, list[ResourceSet]] | None:
        """Claim the longest section available; return why the longest one wanted was refused."""
        refused: tuple[Refusal, list[ResourceSet]] | None = None
        sections = tuple(self._sections(ahead))
        free = self.scheduler.free_of_rest(vehicle, ahead[: sections[0]]) if sections else 0
        for count in sections:
            if count <= more_than and (count or ahead):
                break
            if count > free and refused:
                continue
            way = list(ahead[:count])
            refusal = self._claim(vehicle, way, senior)
            if refusal is None:
                return None
            self._asked.update(refusal.vehicles, refusal.between)
            refused = refused or (refusal, way)
            if refused[0].hindrance is not WaitReason.RESTING and refusal.hindrance is WaitReason.RESTING:
                refused = refusal, way
        return refused

    def _next_stop(self, way: Sequence[ResourceSet]) -> int:
        """Return how many sets lead to the first point of a way where a vehicle can wait."""
        return next((index + 1 for index in range(len(way)) if self.resources.may_wait(way, index)), 0)

    def _sections(self, ahead: Sequence[ResourceSet]) -> Iterator[int]:
        """Yield how many sets may be claimed at once, the wanted number first, then less and less."""
        ends = [index + 1 for index in range(len(ahead)) if self.resources.may_wait(ahead, index)]
        wanted = next((index for index, end in enumerate(ends) if end >= SECTION), len(ends) - 1)
        yield from reversed(ends[: wanted + 1])
        if not ahead:
            yield 0

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
        """Send away those of the ``blockers`` that rest on a route that is already claimed."""
        yield from self._evader.evade(blockers, way, movable)

    def _make_room(
        self,
        requester: str,
        refusal: Refusal,
        kept_free: list[ResourceSet],
        movable: Callable[[str], bool],
        *,
        first: bool,
    ) -> Iterator[Evasion | Displacement]:
        def may_be_sent(other: str) -> bool:
            if not movable(other) or other in self.journeys:
                return False
            return other not in self._requests or first or self._wait_in_ring(other)

        under_way = [other for other in refusal.vehicles if other in self.journeys]
        enclosing, sent = set[str](), False
        for evasion in self._evader.evade(refusal.vehicles, kept_free, may_be_sent, enclosing):
            sent = True
            self._refusals.pop(evasion.vehicle, None)
            if evasion.lets_out:
                at = self.scheduler.occupant(evasion.lets_out).point
                self._lets_out[evasion.vehicle] = _LetOut(evasion.lets_out, at, requester)
            yield evasion
        yield from (Displacement(other) for other in under_way if self._wait_in_ring(other))
        for other in () if sent else sorted(enclosing.intersection(self.journeys).difference(under_way)):
            if self.scheduler.occupant(other).resting and (
                first or self._waits_for(other, enclosing | {requester})
            ):
                yield Displacement(other)

    def _waits_for(self, vehicle: str, others: set[str]) -> bool:
        """Return whether others keep a vehicle from going on; else it merely pauses."""
        refusal = self._refusals.get(vehicle)
        return refusal is not None and not others.isdisjoint(refusal.vehicles)

    def _wait_in_ring(self, vehicle: str) -> bool:
        """Return whether a vehicle waits for itself through others, so that none of them can continue."""
        seen: set[str] = set()
        open_ends = [vehicle]
        while open_ends:
            refusal = self._refusals.get(open_ends.pop())
            for other in refusal.vehicles if refusal else ():
                if other == vehicle:
                    return True
                if other not in seen:
                    seen.add(other)
                    open_ends.append(other)
        return False

    def _grant(
        self, route_request: RouteRequest, senior: _Senior | None, lost: Callable[[str], bool]
    ) -> RouteGrant | RouteRejection | tuple[Refusal, list[ResourceSet]]:
        """Claim the cheapest route or a detour; else return why the cheapest one was refused."""
        try:
            route = self._route(route_request)
        except NoRouteError as error:
            return RouteRejection(route_request.vehicle, error)
        way = self._sets(route_request, route)
        refused = self._claim_way(route_request.vehicle, way, senior, lost)
        if refused is None:
            return RouteGrant(route_request, route, tuple(way))
        refusal, _ = refused
        if route and refusal.hindrance is WaitReason.RESTING:
            longest = inf if any(map(lost, refusal.vehicles)) else route.cost * LONGEST_DETOUR
            detour = self._detour(route_request, way, longest)
            around = self._sets(route_request, detour) if detour else []
            if detour and self._claim_way(route_request.vehicle, around, senior, lost) is None:
                return RouteGrant(route_request, detour, tuple(around))
        return refused

    def _claim_way(
        self, vehicle: str, way: list[ResourceSet], senior: _Senior | None, lost: Callable[[str], bool]
    ) -> tuple[Refusal, list[ResourceSet]] | None:
        """Claim the first section of a route on which no vehicle rests whose departure time is unknown.

        A vehicle that has let another one out must not enclose it again before that one has gone.
        """
        if self._has_let_out(vehicle, lost) or any(map(lost, self.scheduler.resting_on(vehicle, way))):
            refusal = self.scheduler.claim(vehicle, way)
            return (refusal, way) if refusal else None
        return self._claim_section(vehicle, way, senior)

    def _has_let_out(self, vehicle: str, lost: Callable[[str], bool]) -> bool:
        """Return whether the vehicle that this one let out is still there, and still needs to go."""
        known = self._lets_out.get(vehicle)
        if known is None:
            return False
        wanted = known.requester in self._requests or known.requester in self._refusals
        there = known.vehicle in self.scheduler and not lost(known.vehicle)
        if wanted and there and self.scheduler.occupant(known.vehicle).point == known.at:
            return True
        del self._lets_out[vehicle]
        return False

    def _route(self, route_request: RouteRequest, avoid: frozenset[str] = frozenset()) -> Route | None:
        if route_request.straight_mm is not None:
            return None
        vehicle, goal = route_request.vehicle, route_request.goal
        start, kept_off = self.scheduler.occupant(vehicle).point, route_request.avoid | avoid
        if avoid:
            return self._ways.route(vehicle, start, goal, avoid=kept_off)
        known = self._routes.get(vehicle)
        if known and known[0] == (start, route_request):
            return known[1]
        if self._burden_age >= len(self.journeys) // BURDEN_KEPT:
            self._burden, self._burden_age = self._count_burden(), 0
        self._burden_age += 1
        burden = self._burden
        route = self._ways.route(vehicle, start, goal, avoid=kept_off, burden=burden)
        self._routes[vehicle] = (start, route_request), route
        return route

    def _count_burden(self) -> dict[str, float]:
        """Return what vehicles under way make dearer: the points ahead, and what leads towards them."""
        burden: defaultdict[str, float] = defaultdict(float)
        for journey in self.journeys.values():
            for each in journey.way[journey.reached :]:
                burden[each.point] += CONGESTION
                for use in each.uses:
                    for edge in self._oncoming.get((use, each.point), ()):
                        burden[edge] += ONCOMING
        return burden

    def forget_routes(self) -> None:
        """Search again for the routes that vehicles wait for: the plant has changed."""
        self._routes.clear()
        self._refused_sections.clear()

    def _claim(self, vehicle: str, way: list[ResourceSet], senior: _Senior | None) -> Refusal | None:
        end = self.scheduler.end_of(vehicle, way)
        if senior and senior.vehicle != vehicle and (resource := overlap(end, senior.way)):
            return Refusal(WaitReason.ORDER, (senior.vehicle,), resource)
        return self.scheduler.claim(vehicle, way)

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
