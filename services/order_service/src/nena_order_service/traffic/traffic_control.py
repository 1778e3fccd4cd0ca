"""Traffic control: which vehicle may begin or continue its route, and which must make room (decision 0038).

This is prioritised planning, as in multi-agent path finding (MAPF), over resources that are claimed before
they are allocated, as in openTCS. :mod:`.scheduler` ensures safety: it allocates a resource to one vehicle
at a time, and refuses every claim that could lead to a deadlock. The rules here decide who claims what and
when; they guarantee that every request is eventually granted:

1. **Turns.** The oldest request is served first. A vehicle keeps its turn until it reaches its goal.
2. **Sections.** A vehicle claims only the next section of its route, up to a point where it can wait without
   blocking others. Claims are short, so vehicles follow each other closely.
3. **Right of way.** The oldest vehicle that has to wait reserves its next section: no other may claim a way
   that ends there. The section therefore becomes free, however many younger requests there are.
4. **Making room.** Vehicles that rest on the route of another are sent to a free point (:mod:`.evasion`).
   A vehicle with its own request is only sent away for the right of way, or if it waits for itself.
5. **Letting out.** A vehicle that made room for one that it enclosed does not return before that one has
   left. Without this rule, the two would move back and forth forever.
6. **Detours.** A route avoids points and paths with much traffic, and leads around vehicles at rest if that
   is not much longer. A vehicle that waits in traffic gets another route if that is cheaper, unless it
   has the right of way: then others make room on its present one.

A *way* is a route as resource sets in driving order: what the vehicle needs to reach each point.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import inf

from nena_order_service.routing.graph import NoRouteError, Route
from nena_order_service.routing.router import VehicleRoutes
from nena_order_service.traffic.evasion import Evader, Evasion, VehicleTest, no_vehicle, overlap
from nena_order_service.traffic.resources import Resources, ResourceSet
from nena_order_service.traffic.route_search import Journey, RouteRequest, RouteSearch
from nena_order_service.traffic.scheduler import Refusal, Scheduler, SearchLimit, Turns, WaitReason
from nena_shared.plant import PlantModel

SECTION = 4
"""Number of resource sets that a vehicle claims ahead of what it holds; more if it cannot wait there."""
LONGEST_DETOUR = 1.5
"""Maximum cost of a detour around vehicles at rest, as a multiple of the cheapest route's cost."""
CLEARING, MAKING_ROOM = "clearing", "making room"
"""Tasks that are not repeated while a decision is continued."""


@dataclass(frozen=True, slots=True)
class RouteGrant:
    """A vehicle may begin its route; its first section is claimed. ``route`` is None for a straight drive."""

    route_request: RouteRequest
    route: Route | None
    way: tuple[ResourceSet, ...]

    @property
    def vehicle(self) -> str:
        """The vehicle that may begin."""
        return self.route_request.vehicle


@dataclass(frozen=True, slots=True)
class RouteRejection:
    """A vehicle's request is dropped, because no route leads to its goal any more."""

    vehicle: str
    error: NoRouteError


@dataclass(frozen=True, slots=True)
class MoreClaimed:
    """A driving vehicle claims more of its route than before."""

    vehicle: str


@dataclass(frozen=True, slots=True)
class Displacement:
    """A driving vehicle waits where another one has to pass: its route must end there so it can make room."""

    vehicle: str


Decision = RouteGrant | RouteRejection | MoreClaimed | Evasion | Displacement


@dataclass(frozen=True, slots=True)
class _RightOfWay:
    """The oldest vehicle that has to wait, and the section that it reserves."""

    vehicle: str
    section: list[ResourceSet]


@dataclass(frozen=True, slots=True)
class _Refused:
    """A refused claim, and the reason."""

    refusal: Refusal
    way: list[ResourceSet]


@dataclass(frozen=True, slots=True)
class _KnownRefusal:
    """The refused claim of a driving vehicle; valid until one of the vehicles that caused it changes."""

    refused: _Refused
    versions: dict[str, int]


@dataclass(frozen=True, slots=True)
class _KnownAnswer:
    """The refusal of a request; valid until something on which it depended changes."""

    refused: _Refused
    route_request: RouteRequest
    right_of_way: _RightOfWay | None
    lost: dict[str, bool]
    """Whether each of the other vehicles was lost."""
    versions: dict[str, int]
    """Of the vehicle itself, and of those that it waits for."""


@dataclass(frozen=True, slots=True)
class _LetOut:
    """A vehicle that another one let out; it rests ``at`` a point on the requester's way."""

    vehicle: str
    at: str
    requester: str


class TrafficControl:
    """Answers route requests and extends claims by the rules in the module's docstring."""

    def __init__(self, plant: PlantModel, routes: VehicleRoutes, resources: Resources | None = None) -> None:
        self.resources = resources or Resources(plant)
        self.scheduler = Scheduler()
        self.journeys: dict[str, Journey] = {}
        """The routes of the vehicles under way: those that drive or wait on their route."""
        self._routes = RouteSearch(plant, routes, self.scheduler, self.journeys)
        self._limit = SearchLimit(routes)
        self._evader = Evader(plant, self.resources, self.scheduler, routes, self._limit)
        self._turns = Turns()
        self._requests: dict[str, RouteRequest] = {}
        self._refusals: dict[str, Refusal] = {}
        self._known_refusals: dict[str, _KnownRefusal] = {}
        self._known_answers: dict[str, _KnownAnswer] = {}
        self._in_the_way: set[str] = set()
        """The vehicles on which the last attempt to claim a section depended."""
        self._right_of_way: _RightOfWay | None = None
        """The right of way in the last decision."""
        self._lets_out: dict[str, _LetOut] = {}
        """Vehicles that made room for one that they enclosed."""

    @property
    def unfinished(self) -> bool:
        """Whether the last decision reached its search limit before it had handled every vehicle."""
        return self._limit.reached

    def request_route(self, route_request: RouteRequest, *, first: bool = False) -> None:
        """Add a vehicle's request; it replaces the vehicle's earlier request, but keeps its turn.

        A vehicle that has not reached its goal also keeps its turn. One without a turn is served before all
        others if it is ``first``.
        """
        vehicle, goal = route_request.vehicle, route_request.goal
        if self._turns.goal(vehicle) != goal:
            self._lets_out.pop(vehicle, None)
        self._turns.take(vehicle, goal, first=first, waits=vehicle in self._requests)
        self._requests[vehicle] = route_request

    def drop(self, vehicle: str) -> None:
        """Drop a vehicle's request; it keeps its turn."""
        self._requests.pop(vehicle, None)
        self._refusals.pop(vehicle, None)
        self._known_answers.pop(vehicle, None)
        self._routes.forget(vehicle)

    def end_turn(self, vehicle: str, point: str | None) -> None:
        """End the turn of a vehicle that has reached ``point``, if that was its goal."""
        self.forget_refusal(vehicle)
        if vehicle not in self._requests and self._turns.goal(vehicle) == point:
            self._turns.end(vehicle)

    def forget_refusal(self, vehicle: str) -> None:
        """Drop the reason why a vehicle waits, because its route has changed or ended."""
        self._refusals.pop(vehicle, None)

    def forget(self, vehicle: str) -> None:
        """Remove a vehicle and its turn."""
        self.drop(vehicle)
        self._turns.end(vehicle)
        self._lets_out.pop(vehicle, None)

    def forget_routes(self) -> None:
        """Drop the cached routes of waiting vehicles, because the plant has changed."""
        self._routes.forget_all()
        self._known_refusals.clear()
        self.forget_answers()

    def forget_answers(self) -> None:
        """Answer all requests again in the next decision, also those whose reasons to wait still hold.

        A vehicle that has come to rest on the way of a waiting one does not change its other reasons.
        """
        self._known_answers.clear()

    @property
    def requesting(self) -> tuple[str, ...]:
        """The vehicles with a route request, oldest first."""
        return tuple(sorted(self._requests, key=self._turns.number))

    def why_waiting(self, vehicle: str) -> Refusal | None:
        """Return why a vehicle's request is not granted yet, or why no more of its route is claimed."""
        return self._refusals.get(vehicle)

    def displaces(self, route_request: RouteRequest) -> bool:
        """Return whether vehicles at rest, now or soon, would have to make room for this request."""
        try:
            route = self._routes.find(route_request)
        except NoRouteError:
            return False
        way = self._way(route_request, route)
        if route is None or not self.scheduler.rests_or_will_rest_on(route_request.vehicle, way):
            return False
        detour = self._detour(route_request, way, route.cost * LONGEST_DETOUR)
        return detour is None or self.scheduler.rests_or_will_rest_on(
            route_request.vehicle, self._way(route_request, detour)
        )

    def claim_other_way(self, vehicle: str, ahead: Sequence[ResourceSet]) -> Refusal | None:
        """Claim a section of another route from the end of what is held; return the refusal, if any."""
        refused = self._claim_section(vehicle, ahead, self._right_of_way)
        return refused.refusal if refused else None

    def route_around(
        self,
        vehicle: str,
        standing: Iterable[str],
        avoid: Collection[str] = frozenset(),
        stays: VehicleTest = lambda _: True,
    ) -> Route | None:
        """Return a route with less traffic for a vehicle that waits at the end of what it holds.

        ``standing`` are the vehicles that wait now. The route avoids vehicles at rest for which ``stays``
        returns that they may stay for long. None: the current route is about as good, there is no other one,
        or the vehicle has the right of way.
        """
        journey, occupant = self.journeys[vehicle], self.scheduler.occupant(vehicle)
        present = journey.way[journey.allocated :]
        if not present or (self._right_of_way and self._right_of_way.vehicle == vehicle):
            return None
        occupied = [self.scheduler.occupant(other).held for other in standing if other != vehicle]
        start, goal = occupant.held[-1].point, present[-1].point
        at_rest = (each for each in self.scheduler.names if each not in self.journeys and stays(each))
        held = (use for each in at_rest for place in self.scheduler.occupant(each).held for use in place.uses)
        resting = set(held) - {start, goal}
        return self._routes.around(vehicle, start, occupied, avoid, resting)

    def claims_enough_until(self, vehicle: str) -> Collection[str] | None:
        """Return the vehicles of which one must change before this one can claim more; None: unknown."""
        if vehicle in self._refusals:
            return None
        if self._claims_enough(vehicle):
            return ()
        known = self._known_refusal(vehicle)
        return known.versions if known and self.scheduler.occupant(vehicle).claimed else None

    def decide(
        self,
        movable: VehicleTest,
        lost: VehicleTest = no_vehicle,
        extending: Iterable[str] = (),
        searches: float = inf,
    ) -> Iterator[Decision]:
        """Grant requests where possible, oldest turn first, and send away vehicles that rest in the way.

        Args:
            movable: returns whether a vehicle at rest could drive away now.
            lost: returns whether it is unknown when a vehicle at rest could drive away. A vehicle that waits
                for it takes any detour, and never gets the right of way: others would wait forever.
            extending: the vehicles under way that may claim or be allocated more of their routes.
            searches: maximum number of route searches; if they do not suffice, ``unfinished`` is set.

        """
        self._limit.begin(searches)
        under_way_now = list(extending)
        yield from self._clear_ways(under_way_now, movable)
        self._right_of_way = right_of_way = None
        for vehicle in self._in_turn(under_way_now):
            under_way = vehicle in self.journeys
            if under_way:
                claimed = len(self.scheduler.occupant(vehicle).claimed)
                refused = self._extend_claim(vehicle, right_of_way)
                if len(self.scheduler.occupant(vehicle).claimed) > claimed:
                    yield MoreClaimed(vehicle)
            else:
                route_request = self._requests.get(vehicle)
                if not route_request or not self._can_be_granted(route_request) or not movable(vehicle):
                    continue
                answer = self._answer(route_request, right_of_way, lost)
                if isinstance(answer, RouteGrant | RouteRejection):
                    self.drop(vehicle)
                    yield answer
                    continue
                refused = answer
            if refused is None:
                continue
            refusal = self._refusals[vehicle] = refused.refusal
            blocked_at_rest = refusal.reason is WaitReason.RESTING
            if blocked_at_rest and any(map(lost, refusal.vehicles)):
                continue
            if under_way and not self.scheduler.occupant(vehicle).resting:
                continue  # it still drives on the resources that it holds
            right_of_way = right_of_way or _RightOfWay(vehicle, self._next_section(refused.way))
            self._right_of_way = right_of_way
            if blocked_at_rest:
                yield from self._make_room(vehicle, refused, right_of_way, movable)

    def _in_turn(self, extending: Iterable[str]) -> Iterator[str]:
        """Yield the vehicles to serve, oldest turn first, until the search limit is reached."""
        for vehicle in sorted({*self._requests, *extending}, key=self._turns.number):
            if not self._limit.permits():
                return
            yield vehicle

    def _clear_ways(self, extending: list[str], movable: VehicleTest) -> Iterator[Evasion]:
        """Send away vehicles that have stopped early on another one's claimed way.

        Add them to ``extending``, because they are then under way, too.
        """
        for vehicle in tuple(extending):
            journey = self.journeys[vehicle]
            refusal = journey.refusal
            if (
                refusal is None
                or refusal.reason is not WaitReason.RESTING
                or self._limit.is_done(CLEARING, vehicle)
            ):
                continue
            ahead = journey.way[journey.allocated :]
            for evasion in self._evader.evade(refusal.vehicles, ahead, movable):
                extending.append(evasion.vehicle)
                yield evasion
            self._limit.done(CLEARING, vehicle)

    # Route requests: the cheapest route, or a detour around vehicles at rest

    def _can_be_granted(self, route_request: RouteRequest) -> bool:
        """Return whether the request is still current and its vehicle is at rest."""
        vehicle = route_request.vehicle
        if self._requests.get(vehicle) is not route_request or vehicle not in self.scheduler:
            return False
        return self.scheduler.occupant(vehicle).resting

    def _answer(
        self, route_request: RouteRequest, right_of_way: _RightOfWay | None, lost: VehicleTest
    ) -> RouteGrant | RouteRejection | _Refused:
        """Claim the first section of the cheapest route or of a detour; else return the former's refusal.

        A refused request is not answered again until one of the vehicles that caused it has changed.
        """
        vehicle = route_request.vehicle
        known = self._known_answers.get(vehicle)
        if known and self._still_holds(known, route_request, right_of_way, lost):
            return known.refused
        self._in_the_way = {vehicle}
        answer = self._new_answer(route_request, right_of_way, lost)
        if isinstance(answer, _Refused) and vehicle not in self._lets_out:
            self._known_answers[vehicle] = _KnownAnswer(
                answer,
                route_request,
                right_of_way,
                {other: lost(other) for other in self._in_the_way if other != vehicle},
                self.scheduler.versions(self._in_the_way),
            )
        return answer

    def _still_holds(
        self,
        known: _KnownAnswer,
        route_request: RouteRequest,
        right_of_way: _RightOfWay | None,
        lost: VehicleTest,
    ) -> bool:
        """Return whether a request would be refused again for the same reasons."""
        return (
            known.route_request is route_request
            and known.right_of_way == right_of_way
            and known.versions == self.scheduler.versions(known.versions)
            and all(lost(other) == was for other, was in known.lost.items())
        )

    def _new_answer(
        self, route_request: RouteRequest, right_of_way: _RightOfWay | None, lost: VehicleTest
    ) -> RouteGrant | RouteRejection | _Refused:
        vehicle = route_request.vehicle
        try:
            route = self._routes.find(route_request)
        except NoRouteError as error:
            return RouteRejection(vehicle, error)
        way = self._way(route_request, route)
        refused = self._claim_first_section(vehicle, way, right_of_way, lost)
        if refused is None:
            return RouteGrant(route_request, route, tuple(way))
        if route and refused.refusal.reason is WaitReason.RESTING:
            longest = inf if any(map(lost, refused.refusal.vehicles)) else route.cost * LONGEST_DETOUR
            detour = self._detour(route_request, way, longest)
            around = self._way(route_request, detour) if detour else []
            if detour and self._claim_first_section(vehicle, around, right_of_way, lost) is None:
                return RouteGrant(route_request, detour, tuple(around))
        return refused

    def _way(self, route_request: RouteRequest, route: Route | None) -> list[ResourceSet]:
        """Return what the vehicle needs for a route, or for a straight drive to its goal."""
        occupant = self.scheduler.occupant(route_request.vehicle)
        goal, at_goal = route_request.goal, route_request.at_goal
        if route is None:
            return [self.resources.on(goal, (goal, *at_goal), length_mm=route_request.straight_mm or 0)]
        return self.resources.way(route.steps, start=occupant.held[-1], entry=occupant.entry, at_goal=at_goal)

    def _detour(self, route_request: RouteRequest, way: list[ResourceSet], longest: float) -> Route | None:
        """Return a route around vehicles that rest on a way; None if there is none up to cost ``longest``."""
        resting = self.scheduler.resting_on(route_request.vehicle, way)
        held = (each for name in resting for each in self.scheduler.occupant(name).held)
        occupied = {resource for each in held for resource in each.uses}
        try:
            detour = self._routes.find(route_request, without=occupied - {route_request.goal})
        except NoRouteError:
            return None
        return detour if detour and detour.cost <= longest else None

    def _claim_first_section(
        self,
        vehicle: str,
        way: list[ResourceSet],
        right_of_way: _RightOfWay | None,
        lost: VehicleTest,
    ) -> _Refused | None:
        """Claim the first section of a way; return the refusal, if any.

        If a lost vehicle rests on the way, claim the whole way, so that this vehicle does not drive up to
        the lost one and wait there. Do the same for a vehicle that has let another one out and could enclose
        it again.
        """
        resting = self.scheduler.resting_on(vehicle, way)
        self._in_the_way.update(resting)
        if self._has_let_out(vehicle, lost) or any(map(lost, resting)):
            refusal = self.scheduler.claim(vehicle, way)
            if refusal is None:
                return None
            self._in_the_way.update(refusal.vehicles, refusal.between)
            return _Refused(refusal, way)
        return self._claim_section(vehicle, way, right_of_way)

    # Sections: how much of a route is claimed at once

    def _extend_claim(self, vehicle: str, right_of_way: _RightOfWay | None) -> _Refused | None:
        """Claim more of a route under way; return the refusal if the vehicle is left without any claim.

        A refused claim is not retried until one of the vehicles that caused the refusal has changed, unless
        the right of way caused it: another vehicle may have it next time.
        """
        journey, claimed = self.journeys[vehicle], len(self.scheduler.occupant(vehicle).claimed)
        if self._claims_enough(vehicle):
            self._refusals.pop(vehicle, None)
            return None
        if known := self._known_refusal(vehicle):
            refused: _Refused | None = known.refused
        else:
            self._limit.claims += 1
            self._in_the_way = {vehicle}
            ahead = journey.way[journey.allocated :]
            refused = self._claim_section(vehicle, ahead, right_of_way, more_than=claimed)
            if refused and (not right_of_way or right_of_way.vehicle not in self._in_the_way):
                versions = self.scheduler.versions(self._in_the_way)
                self._known_refusals[vehicle] = _KnownRefusal(refused, versions)
        if refused is None or claimed:
            self._refusals.pop(vehicle, None)
            return None
        return refused

    def _claims_enough(self, vehicle: str) -> bool:
        """Return whether a vehicle under way claims a whole section, or all of its route."""
        journey, claimed = self.journeys[vehicle], len(self.scheduler.occupant(vehicle).claimed)
        return claimed >= SECTION or claimed == len(journey.way) - journey.allocated

    def _known_refusal(self, vehicle: str) -> _KnownRefusal | None:
        """Return the last refusal of a vehicle's claim, unless one of its causes has changed."""
        known = self._known_refusals.get(vehicle)
        return known if known and known.versions == self.scheduler.versions(known.versions) else None

    def _claim_section(
        self,
        vehicle: str,
        ahead: Sequence[ResourceSet],
        right_of_way: _RightOfWay | None,
        *,
        more_than: int = 0,
    ) -> _Refused | None:
        """Claim the longest section available; otherwise return why the longest one was refused.

        Vehicles at rest take precedence as the reason, because they can be sent away.
        """
        refused: _Refused | None = None
        sections = tuple(self._sections(ahead))
        free = self.scheduler.free_of_rest(vehicle, ahead[: sections[0]]) if sections else 0
        for count in sections:
            if count <= more_than and (count or ahead):
                break
            if count > free and refused:
                continue
            way = list(ahead[:count])
            refusal = self._claim(vehicle, way, right_of_way)
            if refusal is None:
                return None
            self._in_the_way.update(refusal.vehicles, refusal.between)
            refused = refused or _Refused(refusal, way)
            if refused.refusal.reason is not WaitReason.RESTING and refusal.reason is WaitReason.RESTING:
                refused = _Refused(refusal, way)
        return refused

    def _claim(
        self, vehicle: str, way: list[ResourceSet], right_of_way: _RightOfWay | None
    ) -> Refusal | None:
        """Claim a way unless it ends on the section reserved by right of way; return the refusal, if any."""
        if right_of_way and right_of_way.vehicle != vehicle:
            resource = overlap(self.scheduler.end_of(vehicle, way), right_of_way.section)
            if resource:
                return Refusal(WaitReason.ORDER, (right_of_way.vehicle,), resource)
        return self.scheduler.claim(vehicle, way)

    def _sections(self, ahead: Sequence[ResourceSet]) -> Iterator[int]:
        """Yield how many sets may be claimed at once, from the first waiting place after SECTION down."""
        ends = list[int]()
        for end in self.resources.waiting_places(ahead):
            ends.append(end)
            if end >= SECTION:
                break
        yield from reversed(ends)
        if not ahead:
            yield 0

    def _next_section(self, way: list[ResourceSet]) -> list[ResourceSet]:
        """Return the sets of a way up to the first point where a vehicle can wait."""
        return way[: next(self.resources.waiting_places(way), 0)]

    # Making room: sending away vehicles that rest in the way

    def _make_room(
        self, requester: str, refused: _Refused, right_of_way: _RightOfWay, movable: VehicleTest
    ) -> Iterator[Evasion | Displacement]:
        """Send away vehicles that rest on the requester's way, and end the routes of those that wait on it.

        A vehicle with its own request is only sent away for the right of way, or if it waits for itself
        through others and would never leave. A vehicle under way that encloses one that has to make room is
        displaced if no other vehicle could be sent.
        """
        has_right_of_way = right_of_way.vehicle == requester
        if self._limit.is_done(MAKING_ROOM, requester):
            return

        def may_be_sent(other: str) -> bool:
            if not movable(other) or other in self.journeys:
                return False
            return other not in self._requests or has_right_of_way or self._waits_for_itself(other)

        blockers = refused.refusal.vehicles
        under_way = [other for other in blockers if other in self.journeys]
        kept_free = [*right_of_way.section, *refused.way]
        enclosing, sent = set[str](), False
        for evasion in self._evader.evade(blockers, kept_free, may_be_sent, enclosing):
            sent = True
            self._refusals.pop(evasion.vehicle, None)
            if evasion.lets_out:
                at = self.scheduler.occupant(evasion.lets_out).point
                self._lets_out[evasion.vehicle] = _LetOut(evasion.lets_out, at, requester)
            yield evasion
        self._limit.done(MAKING_ROOM, requester)
        if self._limit.reached:
            return
        yield from (Displacement(other) for other in under_way if self._waits_for_itself(other))
        for other in () if sent else sorted(enclosing.intersection(self.journeys).difference(under_way)):
            if self.scheduler.occupant(other).resting and (
                has_right_of_way or self._waits_for(other, enclosing | {requester})
            ):
                yield Displacement(other)

    def _waits_for(self, vehicle: str, others: set[str]) -> bool:
        """Return whether a vehicle waits for one of the others; otherwise it only pauses."""
        refusal = self._refusals.get(vehicle)
        return refusal is not None and not others.isdisjoint(refusal.vehicles)

    def _waits_for_itself(self, vehicle: str) -> bool:
        """Return whether a vehicle waits for itself through others, so that they are deadlocked."""
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

    def _has_let_out(self, vehicle: str, lost: VehicleTest) -> bool:
        """Return whether the vehicle that this one let out is still there and still has to leave."""
        known = self._lets_out.get(vehicle)
        if known is None:
            return False
        wanted = known.requester in self._requests or known.requester in self._refusals
        there = known.vehicle in self.scheduler and not lost(known.vehicle)
        if wanted and there and self.scheduler.occupant(known.vehicle).point == known.at:
            return True
        del self._lets_out[vehicle]
        return False
