"""Traffic manager: who may begin or continue its route, who makes room, and what each vehicle reserves.

This is prioritised planning, as in multi-agent path finding (MAPF), over resources that are claimed before
they are allocated, as in openTCS (decision 0038). :mod:`.scheduler` ensures safety: it allocates a resource
to one vehicle at a time, and refuses every claim that could lead to a deadlock. The rules here decide who
claims what and when; they guarantee that every request is eventually granted:

1. **Turns.** The oldest request is served first. A vehicle keeps its turn until it reaches its goal.
2. **Sections.** A vehicle claims only the next section of its route, up to a point where it can wait without
   blocking others. Claims are short, so vehicles follow each other closely.
3. **Right of way.** The oldest vehicle that has to wait reserves its next section: no other may claim a way
   that ends there. The section therefore becomes free, however many younger requests there are.
4. **Relocation.** Vehicles that rest on the route of another are sent to a free point (:mod:`.relocation`).
   A vehicle with its own request is only sent away for the right of way, or if it waits for itself or for
   a stuck one.
5. **Letting out.** A vehicle that was relocated for one that it enclosed does not return before that one has
   left. Without this rule, the two would move back and forth forever.
6. **Detours.** A route avoids points and paths with much traffic, and leads around vehicles at rest if that
   is not much longer. A vehicle that waits in traffic gets another route if that is cheaper, unless it
   has the right of way: then others are relocated from its present one.
7. **Containment.** Vehicles that wait behind a stopped one are *stuck* with it. Until it drives on, no other
   one begins or continues a route through them, except a detour, and they claim nothing. Routes through them
   end where the vehicles are, and any other vehicle may send those away.

A *way* is a route as resource sets in driving order: what the vehicle needs to reach each point.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Protocol

from nena_order_service.routing.graph import NoRouteError, Route, Step
from nena_order_service.routing.router import VehicleRoutes
from nena_order_service.traffic.relocation import (
    Relocation,
    Relocator,
    VehicleTest,
    find_conflict,
    no_vehicle,
)
from nena_order_service.traffic.resources import Found, OccupancyFinder, Resources, ResourceSet
from nena_order_service.traffic.route_search import AllocatedRoute, RouteRequest, RouteSearch
from nena_order_service.traffic.scheduler import Refusal, Scheduler, WaitReason
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import PlantModel
from nena_shared.plant.track import BoundingBox

R = ReasonCode

SECTION = 4
"""Number of resource sets that a vehicle claims ahead of what it holds; more if it cannot wait there."""
LONGEST_DETOUR = 1.5
"""Maximum cost of a detour around vehicles at rest, as a multiple of the cheapest route's cost."""


class Gate(Protocol):
    """Says how far a route may be allocated and released; it is asked for one set after the other."""

    def may_allocate(self, index: int) -> bool:
        """Return whether a set of the route, which the vehicle needs now, may be allocated."""
        ...

    def may_release(self, index: int) -> bool:
        """Return whether a set that is allocated may be driven."""
        ...


class OpenGate:
    """Stops nothing."""

    def may_allocate(self, index: int) -> bool:
        """Return True."""
        del index
        return True

    may_release = may_allocate


OPEN = OpenGate()


@dataclass(frozen=True, slots=True)
class RouteGrant:
    """A vehicle may begin the route that it requested; its first section is claimed."""

    vehicle: str
    route: Route | None
    """None for a straight drive."""


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
class EarlyEnd:
    """A driving vehicle waits where another one has to pass: its route must end, so it can be relocated."""

    vehicle: str


Decision = RouteGrant | RouteRejection | MoreClaimed | Relocation | EarlyEnd


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
class _LastRefusal:
    """The last refusal of a vehicle's claim: the same again until one of its ``causes`` changes."""

    refused: _Refused
    causes: frozenset[str]
    """The vehicle itself, and the others on which the refusal depended."""
    right_of_way: _RightOfWay | None
    lost: frozenset[str] = frozenset()
    """Those of the causes that were lost."""


@dataclass(frozen=True, slots=True)
class _LetOut:
    """A vehicle that another one let out; it rests ``at`` a point on the requester's way."""

    vehicle: str
    at: str
    requester: str


class TrafficManager:
    """Manages the resources and routes of the vehicles in one plant; vehicles are identified by name.

    A vehicle at rest is *seen* at a position. It *requests* a route, which :meth:`decide` grants. The route's
    resource sets are *allocated* in driving order (openTCS: allocation). A set is freed once the vehicle has
    *arrived* at a later one and its length no longer covers it. A vehicle that breaks off its route keeps
    everything it held until it is seen standing. A resource is never allocated to two vehicles; only vehicles
    that were found at the same position share one.
    """

    def __init__(
        self, plant: PlantModel, routes: VehicleRoutes, *, exclusive: bool = True, peripherals: bool = True
    ) -> None:
        """``peripherals``: whether vehicles need the peripheral devices of their paths."""
        self.resources = Resources(plant, exclusive=exclusive, peripherals=peripherals)
        self.scheduler = Scheduler()
        self._occupancy = OccupancyFinder(plant, self.resources)
        self._routes: dict[str, AllocatedRoute] = {}
        """The routes of the vehicles under way: those that drive or wait on their route."""
        self._search = RouteSearch(plant, routes, self.scheduler, self._routes)
        self._relocator = Relocator(plant, self.resources, self.scheduler, routes)
        self._requests: dict[str, RouteRequest] = {}
        self._turns: dict[str, tuple[int, str]] = {}
        """By vehicle: the number of its turn, lower ones are served first, and its goal."""
        self._last_turn = 0
        self._refusals: dict[str, Refusal] = {}
        """Why requests are not granted yet, or why no more of a route is claimed."""
        self._last_refusals: dict[str, _LastRefusal] = {}
        self._settled: dict[str, frozenset[str]] = {}
        """Vehicles under way that need nothing until one of the named vehicles changes."""
        self._right_of_way: _RightOfWay | None = None
        """The right of way in the last decision."""
        self._stopped = self._stuck = frozenset[str]()
        """Vehicles under way that cannot drive on by themselves; and those with the ones behind them."""
        self._let_out: dict[str, _LetOut] = {}
        """By vehicle that was relocated: the one that it enclosed."""
        self._broken_off: dict[str, tuple[ResourceSet, ...]] = {}
        """The resource sets where vehicles may be that broke off their routes or are moved by hand, up to the
        next point of their routes."""
        self._left_at: dict[str, tuple[ResourceSet, ...]] = {}
        """The same for vehicles that have since been seen standing beside a point, until they are on one or
        drive on. Their pose alone may wrongly show them clear of a curved path."""

    # Queries

    def __contains__(self, vehicle: str) -> bool:
        """Return whether the vehicle holds anything."""
        return vehicle in self.scheduler

    def held_by(self, vehicle: str) -> tuple[ResourceSet, ...]:
        """Return what a vehicle holds, oldest first; empty for an unknown vehicle."""
        return tuple(self.scheduler.occupant(vehicle).held) if vehicle in self.scheduler else ()

    def stands_at(self, vehicle: str, point: str, *, on_point: bool) -> bool:
        """Return whether the vehicle is on this point or, unless ``on_point``, nearest to it."""
        occupant = self.scheduler.occupant(vehicle)
        return occupant.point == point and (occupant.entry is None) == on_point

    def route_of(self, vehicle: str) -> AllocatedRoute | None:
        """Return the vehicle's route, read-only; None if it is at rest."""
        return self._routes.get(vehicle)

    def routes_to_extend(self) -> list[tuple[str, AllocatedRoute]]:
        """Return the driving vehicles to which more may be allocated, with their routes.

        The others, of which there may be many, need no traffic control for now: their whole routes are
        allocated, or they hold and claim enough until they or the vehicles ahead of them change.
        """
        settled, changed = self._settled, self.scheduler.changed
        return [
            (name, route)
            for name, route in self._routes.items()
            if (name not in settled or not changed.isdisjoint(settled[name])) and not route.all_allocated
        ]

    @property
    def waiting_vehicles(self) -> frozenset[str]:
        """The vehicles that may be waiting for traffic, under way or before departure."""
        return frozenset((*(name for name, _ in self.routes_to_extend()), *self._requests))

    def refusal_of(self, vehicle: str) -> Refusal | None:
        """Return the refusal for which a vehicle waits; None if it does not wait for traffic."""
        route = self._routes.get(vehicle)
        return (route and route.refusal) or self._refusals.get(vehicle)

    def waiting_at_end(self) -> dict[str, int]:
        """Return the vehicles that wait at the end of what they hold, and how far each has driven."""
        return {
            name: route.reached
            for name, route in self.routes_to_extend()
            if (route.refusal or name in self._stuck) and not self.scheduler.occupant(name).ahead
        }

    def is_blocked(self, vehicle: str) -> bool:
        """Return whether a vehicle at rest blocks this one on its route."""
        route = self._routes.get(vehicle)
        refusal = route.refusal if route else None
        return refusal is not None and refusal.reason is WaitReason.RESTING

    def stuck_vehicles(self, movable: VehicleTest, lost: VehicleTest) -> Iterator[str]:
        """Yield the driving vehicles that wait for vehicles at rest which cannot be relocated.

        Those cannot be moved, or it is unknown when they can. Call this after :meth:`decide`.
        """
        for vehicle, route in self.routes_to_extend():
            if self.is_blocked(vehicle) and route.refusal:
                blockers = [name for name in route.refusal.vehicles if name not in self._routes]
                if blockers and all(movable(name) or lost(name) for name in blockers):
                    yield vehicle
            elif self.scheduler.occupant(vehicle).resting:
                refusal = self._refusals.get(vehicle)
                if refusal and refusal.reason is WaitReason.RESTING and any(map(lost, refusal.vehicles)):
                    yield vehicle

    def shared_with(self, vehicle: str) -> Reason | None:
        """Return, as a predicate, which vehicle stands on the same resource; None if there is none."""
        shared = self.scheduler.find_sharer(vehicle) if vehicle in self.scheduler else None
        return Reason(R.SHARES, at=shared[1], vehicle=shared[0]) if shared else None

    def would_displace(self, vehicle: str, goal: str) -> bool:
        """Return whether vehicles that rest, now or soon, would have to make room for a drive to ``goal``."""
        route_request = RouteRequest(vehicle, goal)
        try:
            route = self._search.find_route(route_request)
        except NoRouteError:
            return False
        way = self._resources_along(route_request, route)
        if route is None or not self.scheduler.rests_or_will_rest_on(vehicle, way):
            return False
        detour = self._find_detour(route_request, way, route.cost * LONGEST_DETOUR)
        return detour is None or self.scheduler.rests_or_will_rest_on(
            vehicle, self._resources_along(route_request, detour)
        )

    def route_around(
        self,
        vehicle: str,
        avoid: Collection[str] = frozenset(),
        stays: VehicleTest = lambda _: True,
    ) -> Route | None:
        """Return a route with less traffic for a vehicle that waits at the end of what it holds.

        The route avoids vehicles at rest for which ``stays`` returns that they may stay for long. None: the
        current route is about as good, there is no other one, or the vehicle has the right of way.
        """
        route, occupant = self._routes[vehicle], self.scheduler.occupant(vehicle)
        present = route.way[route.allocated :]
        # For the vehicle with the right of way the others make room: a new route would make that vain.
        if not present or (self._right_of_way and self._right_of_way.vehicle == vehicle):
            return None
        others = (name for name in self.waiting_at_end() if name != vehicle)
        occupied = [self.scheduler.occupant(name).held for name in others]
        start, goal = occupant.held[-1].point, present[-1].point
        at_rest = (name for name in self.scheduler.vehicle_names if name not in self._routes and stays(name))
        resting = {use for name in at_rest for held in self.held_by(name) for use in held.uses} - {
            start,
            goal,
        }
        stuck = {use for name in self._stuck - {vehicle} for held in self.held_by(name) for use in held.uses}
        is_closed = any(not stuck.isdisjoint(resource_set.uses) for resource_set in present)
        closed = resting | (stuck - {start, goal})
        return self._search.find_detour(vehicle, start, occupied, avoid, closed, is_closed=is_closed)

    # Vehicles without a route: what they occupy

    def update_position(self, vehicle: str, found: Found, box: BoundingBox, *, moving: bool = False) -> bool:
        """Make a vehicle without a route hold the resources at the position where it was seen.

        Return whether that changes what it holds.

        While it is ``moving`` it also keeps what it held before. After a completed route, the route shows
        more precisely than the pose what the vehicle's length covers. After a route that was broken off, the
        vehicle also keeps the resources next to its last position, because paths may be curved.
        """
        beside = self.sets_beside(vehicle)
        footing, behind = (
            self._occupancy.find_occupied(found, box),
            self._still_covered(vehicle, found, moving=moving),
        )
        if behind and behind[-1].point == found.point and found.on_point and not moving:
            held, entry = behind, None
        else:
            held = (*(place for place in behind if place != footing.under), footing.under)
            entry = footing.entry
        if moving:
            is_there = vehicle in self.scheduler and self.scheduler.occupant(vehicle).point == found.point
            self._broken_off.setdefault(vehicle, self.held_by(vehicle) if is_there else ())
        else:
            remembered = self._broken_off.pop(vehicle, None)
            if found.on_point:
                self._left_at.pop(vehicle, None)
            elif remembered is not None:
                self._left_at[vehicle] = remembered
        if vehicle in self.scheduler:
            occupant = self.scheduler.occupant(vehicle)
            same_length = occupant.length_mm == box.length_mm
            if tuple(occupant.held) == held and occupant.entry == entry and same_length:
                return beside != self.sets_beside(vehicle)
        self.scheduler.place_at_rest(vehicle, held, box.length_mm, entry=entry)
        return True

    def _still_covered(self, vehicle: str, found: Found, *, moving: bool) -> tuple[ResourceSet, ...]:
        """Return those of a vehicle's held sets that it still covers at the position where it was found."""
        held = self.held_by(vehicle)
        if moving:
            return held
        remembered = self.sets_beside(vehicle)
        passed = held if remembered is None else remembered
        if found.on_point:
            at = [index for index, place in enumerate(passed) if place.point == found.point]
            return passed[: at[-1] + 1] if at else ()
        return () if remembered is None else passed

    def sets_beside(self, vehicle: str) -> tuple[ResourceSet, ...] | None:
        """Return what a vehicle that broke off may occupy; None: it did not, or has been seen on a point."""
        return self._broken_off.get(vehicle, self._left_at.get(vehicle))

    def broke_off(self, vehicle: str) -> bool:
        """Return whether a vehicle broke off or moved without a route, and was not seen standing since."""
        return vehicle in self._broken_off

    def restore_position(
        self,
        vehicle: str,
        held: Sequence[ResourceSet],
        length_mm: int,
        *,
        beside: tuple[ResourceSet, ...] | None = None,
    ) -> None:
        """Restore what a vehicle held before a restart; with ``beside`` it must be seen standing first."""
        self.scheduler.place_at_rest(vehicle, held, length_mm)
        if beside is not None:
            self._broken_off[vehicle] = beside

    def remove_vehicle(self, vehicle: str) -> None:
        """Remove a vehicle: it no longer holds, requests or claims anything."""
        self.drop_request(vehicle)
        self._turns.pop(vehicle, None)
        self._let_out.pop(vehicle, None)
        self._routes.pop(vehicle, None)
        self._broken_off.pop(vehicle, None)
        self._left_at.pop(vehicle, None)
        self.scheduler.remove(vehicle)

    # Requests

    def request_route(self, route_request: RouteRequest, *, first: bool = False) -> None:
        """Add a vehicle's request; it replaces the vehicle's earlier request, but keeps its turn.

        A vehicle that has not reached its goal also keeps its turn. One without a turn is served before all
        others if it is ``first``.
        """
        vehicle, goal = route_request.vehicle, route_request.goal
        number, last_goal = self._turns.get(vehicle, (None, ""))
        # Letting out only forbids to return: to another goal, the vehicle may drive at once.
        if goal != last_goal:
            self._let_out.pop(vehicle, None)
        if first and number is None:
            number = min((number for number, _ in self._turns.values()), default=0) - 1
        elif number is None or not (first or vehicle in self._requests or goal == last_goal):
            self._last_turn += 1
            number = self._last_turn
        self._turns[vehicle] = number, goal
        self._requests[vehicle] = route_request
        self._last_refusals.pop(vehicle, None)

    def drop_request(self, vehicle: str) -> None:
        """Drop a vehicle's request; it keeps its turn."""
        self._requests.pop(vehicle, None)
        self._refusals.pop(vehicle, None)
        self._last_refusals.pop(vehicle, None)
        self._search.forget_route(vehicle)

    def forget_routes(self) -> None:
        """Drop the cached routes of waiting vehicles, because the plant has changed."""
        self._search.forget_all()
        self._last_refusals.clear()
        self._settled.clear()

    def _turn_of(self, vehicle: str) -> int:
        return self._turns.get(vehicle, (0, ""))[0]

    # Decisions

    def decide(self, movable: VehicleTest, lost: VehicleTest = no_vehicle) -> Iterator[Decision]:
        """Grant requests where possible, oldest turn first, and relocate vehicles that rest in the way.

        Args:
            movable: returns whether a vehicle at rest could drive away now.
            lost: returns whether it is unknown when a vehicle at rest could drive away. A vehicle that waits
                for it takes any detour, and never gets the right of way: others would wait forever.

        """
        self._find_stuck()
        extending = [name for name, _ in self.routes_to_extend()]
        yield from self._clear_ways(extending, movable)
        self._right_of_way = right_of_way = None
        # Prioritised planning: the oldest turn comes first, whether its vehicle drives or waits to depart.
        vehicles = dict.fromkeys((*self._requests, *extending))
        for vehicle in sorted(vehicles, key=self._turn_of):
            if under_way := vehicle in self._routes:
                claimed = len(self.scheduler.occupant(vehicle).claimed)
                refused = self._extend_claim(vehicle, right_of_way)
                if len(self.scheduler.occupant(vehicle).claimed) > claimed:
                    yield MoreClaimed(vehicle)
            else:
                # The caller acts on each decision before the next one is made: the request may be gone.
                is_known = vehicle in self._requests and vehicle in self.scheduler
                if not (is_known and self.scheduler.occupant(vehicle).resting and movable(vehicle)):
                    continue
                answer = self._try_request(self._requests[vehicle], right_of_way, lost)
                if not isinstance(answer, _Refused):
                    yield answer
                    continue
                refused = answer
            if refused is None:
                continue
            refusal = self._refusals[vehicle] = self._with_distance(refused.refusal, self.refusal_of(vehicle))
            blocked_at_rest = refusal.reason is WaitReason.RESTING
            # Nobody knows when such a vehicle moves on: a right of way for its sake would block all others.
            if self._is_long_wait(refusal, lost):
                yield from self._end_cut_off(vehicle)
                continue
            if under_way and not self.scheduler.occupant(vehicle).resting:
                continue  # it still drives on the resources that it holds
            # The first that waits is the oldest. It reserves no more than it needs to stop blocking others:
            # reserving the whole route, as under decision 0021, left most vehicles of a full hall standing.
            end = next(self.resources.waiting_places(refused.way), 0)
            right_of_way = right_of_way or _RightOfWay(vehicle, refused.way[:end])
            self._right_of_way = right_of_way
            if blocked_at_rest:
                yield from self._make_room(vehicle, refused, right_of_way, movable)
        self._settle_routes(extending)

    def note_stopped(self, vehicles: Iterable[str]) -> bool:
        """Note which vehicles under way cannot drive on by themselves; return whether others may be stuck."""
        stopped = self._routes.keys() & set(vehicles)
        changed, self._stopped = stopped != self._stopped, frozenset(stopped)
        for name in stopped:
            self.scheduler.give_up_claim(name)  # others may go first now
        return changed

    def _find_stuck(self) -> None:
        """Find the vehicles that wait behind stopped ones, directly or behind others, under way."""
        stuck = set(self._stopped.intersection(self._routes))
        waiting = {
            name: refusal.vehicles
            for name in (self._routes if stuck else ())
            if (refusal := self.refusal_of(name)) and not self.scheduler.occupant(name).ahead
        }
        while behind := {name for name in waiting if not stuck.isdisjoint(waiting[name])} - stuck:
            stuck |= behind
            for name in behind:
                self.scheduler.give_up_claim(name)
        self._relocator.closed = [held for name in stuck for held in self.held_by(name)]
        if stuck != self._stuck:
            self._stuck = frozenset(stuck)
            self._last_refusals.clear()
            self._settled.clear()

    def _find_stuck_on(self, vehicle: str, way: Sequence[ResourceSet]) -> Refusal | None:
        """Return a refusal by the stuck vehicles that hold something on a way; None if there are none."""
        found = {
            name: resource
            for name in sorted(self._stuck - {vehicle})
            if (resource := find_conflict(way, self.held_by(name)))
        }
        return Refusal(WaitReason.HELD, tuple(found), next(iter(found.values()))) if found else None

    def _clear_ways(self, extending: list[str], movable: VehicleTest) -> Iterator[Relocation]:
        """Relocate vehicles that have stopped early on another one's claimed way.

        Add them to ``extending``, because they are then under way, too.
        """
        for vehicle in tuple(extending):
            route = self._routes[vehicle]
            if route.refusal is None or route.refusal.reason is not WaitReason.RESTING:
                continue
            ahead = route.way[route.allocated :]
            for relocation in self._relocator.relocate(route.refusal.vehicles, ahead, movable):
                extending.append(relocation.vehicle)
                self._start_route(relocation.vehicle, relocation.way)
                yield relocation

    def _is_long_wait(self, refusal: Refusal, lost: VehicleTest) -> bool:
        """Return whether it is unknown when a vehicle for which another one waits drives on."""
        at_rest = refusal.reason is WaitReason.RESTING
        return any(name in self._stuck or (at_rest and lost(name)) for name in refusal.vehicles)

    def _is_cut_off(self, vehicle: str) -> bool:
        """Return whether a vehicle waits for a stuck one: it has no way, and may be sent anywhere."""
        refusal = self._refusals.get(vehicle)
        return refusal is not None and not self._stuck.isdisjoint(refusal.vehicles)

    def _end_cut_off(self, vehicle: str) -> Iterator[EarlyEnd]:
        """End the route of a vehicle under way that waits for a stuck one."""
        if vehicle in self._routes and self._is_cut_off(vehicle):
            yield EarlyEnd(vehicle)

    def _with_distance(self, refusal: Refusal, last: Refusal | None) -> Refusal:
        """Return a refusal with the distance that the other vehicle would have to turn back.

        That is the distance from when the vehicle began to wait. The current one changes with each node, and
        each change of a vehicle's status is stored and published.
        """
        if last and last.cause == refusal.cause:
            distance = last.turn_back_mm
        else:
            distance = self.scheduler.turn_back_mm(refusal)
        return replace(refusal, turn_back_mm=distance) if distance else refusal

    def _start_route(
        self, vehicle: str, way: Sequence[ResourceSet], route_request: RouteRequest | None = None
    ) -> None:
        self._left_at.pop(vehicle, None)
        self._routes[vehicle] = AllocatedRoute(tuple(way), route_request=route_request)

    def _settle_routes(self, vehicles: Iterable[str]) -> None:
        """Leave out of later decisions those vehicles that can neither be allocated nor claim more."""
        self._forget_outdated()
        for vehicle in vehicles:
            route = self._routes.get(vehicle)
            if route is None or route.refusal or not route.holds_enough or vehicle in self._refusals:
                continue
            last = self._last_refusals.get(vehicle)
            if self._claims_enough(vehicle):
                self._settled[vehicle] = frozenset((vehicle,))
            elif last and self.scheduler.occupant(vehicle).claimed:
                self._settled[vehicle] = last.causes

    def _forget_outdated(self) -> None:
        """Forget what was known of vehicles that have changed, or that depend on one that has."""
        changed = self.scheduler.changed
        if not changed:
            return
        for name in changed & self._routes.keys():
            self._routes[name].holds_enough = False
        if any(name in self.scheduler and self.scheduler.occupant(name).resting for name in changed):
            # It may rest on the way of any other vehicle, which then waits for it, too, and has it relocated.
            self._last_refusals.clear()
        for name, last in tuple(self._last_refusals.items()):
            if not changed.isdisjoint(last.causes):
                del self._last_refusals[name]
        for name in [name for name, causes in self._settled.items() if not changed.isdisjoint(causes)]:
            del self._settled[name]
        changed.clear()

    # Route requests: the cheapest route, or a detour around vehicles at rest

    def _try_request(
        self, route_request: RouteRequest, right_of_way: _RightOfWay | None, lost: VehicleTest
    ) -> RouteGrant | RouteRejection | _Refused:
        """Claim the first section of the cheapest route or of a detour; else return the former's refusal.

        A refused request is not answered again until one of the vehicles that caused it has changed.
        """
        vehicle = route_request.vehicle
        self._forget_outdated()
        last = self._last_refusals.get(vehicle)
        if (
            last
            and last.right_of_way == right_of_way
            and self._lost_causes(last.causes, vehicle, lost) == last.lost
        ):
            return last.refused
        try:
            route = self._search.find_route(route_request)
        except NoRouteError as error:
            self.drop_request(vehicle)
            return RouteRejection(vehicle, error)
        causes = {vehicle}
        way = self._resources_along(route_request, route)
        refused = self._claim_first_section(vehicle, way, right_of_way, lost, causes)
        is_long = refused is not None and self._is_long_wait(refused.refusal, lost)
        if refused and route and (is_long or refused.refusal.reason is WaitReason.RESTING):
            # A detour is searched only around vehicles at rest or stuck: others will soon be gone.
            longest = inf if is_long else route.cost * LONGEST_DETOUR
            if detour := self._find_detour(route_request, way, longest):
                around = self._resources_along(route_request, detour)
                if self._claim_first_section(vehicle, around, right_of_way, lost, causes) is None:
                    route, way, refused = detour, around, None
        if refused is None:
            self.drop_request(vehicle)
            self._start_route(vehicle, way, route_request)
            return RouteGrant(vehicle, route)
        # A vehicle that let another one out waits for that one's request, too, which is not among the causes.
        if vehicle not in self._let_out:
            last_lost = self._lost_causes(causes, vehicle, lost)
            self._last_refusals[vehicle] = _LastRefusal(refused, frozenset(causes), right_of_way, last_lost)
        return refused

    def _lost_causes(self, causes: Iterable[str], vehicle: str, lost: VehicleTest) -> frozenset[str]:
        return frozenset(name for name in causes if name != vehicle and lost(name))

    def _resources_along(self, route_request: RouteRequest, route: Route | None) -> list[ResourceSet]:
        """Return what the vehicle needs for a route, or for a straight drive to its goal."""
        occupant = self.scheduler.occupant(route_request.vehicle)
        goal, at_goal = route_request.goal, route_request.at_goal
        if route is None:
            return [
                self.resources.on_members(goal, (goal, *at_goal), length_mm=route_request.straight_mm or 0)
            ]
        return self.resources.for_route(
            route.steps, start=occupant.held[-1], entry=occupant.entry, at_goal=at_goal
        )

    def _find_detour(
        self, route_request: RouteRequest, way: list[ResourceSet], longest: float
    ) -> Route | None:
        """Return a route around vehicles that rest on a way; None if there is none up to cost ``longest``."""
        vehicle = route_request.vehicle
        resting = {*self.scheduler.resting_on(vehicle, way), *self._stuck.difference((vehicle,))}
        occupied = {use for name in resting for held in self.held_by(name) for use in held.uses}
        try:
            detour = self._search.find_route(route_request, without=occupied - {route_request.goal})
        except NoRouteError:
            return None
        return detour if detour and detour.cost <= longest else None

    def _claim_first_section(
        self,
        vehicle: str,
        way: list[ResourceSet],
        right_of_way: _RightOfWay | None,
        lost: VehicleTest,
        causes: set[str],
    ) -> _Refused | None:
        """Claim the first section of a way; return the refusal, if any.

        If a lost vehicle rests on the way, claim the whole way, so that this vehicle does not drive up to
        the lost one and wait there. Do the same for a vehicle that has let another one out and could enclose
        it again.
        """
        if refusal := self._find_stuck_on(vehicle, way):
            causes.update(refusal.vehicles)
            return _Refused(refusal, way)
        resting = self.scheduler.resting_on(vehicle, way)
        causes.update(resting)
        if self._has_let_out(vehicle, lost) or any(map(lost, resting)):
            refusal = self.scheduler.claim(vehicle, way)
            if refusal is None:
                return None
            causes.update(refusal.vehicles, refusal.between)
            return _Refused(refusal, way)
        return self._claim_section(vehicle, way, right_of_way, causes)

    # Sections: how much of a route is claimed at once

    def _extend_claim(self, vehicle: str, right_of_way: _RightOfWay | None) -> _Refused | None:
        """Claim more of a route under way; return the refusal if the vehicle is left without any claim.

        A refused claim is not retried until one of the vehicles that caused the refusal has changed, unless
        the right of way caused it: another vehicle may have it next time.
        """
        route, claimed = self._routes[vehicle], len(self.scheduler.occupant(vehicle).claimed)
        if vehicle in self._stopped or self._claims_enough(vehicle):
            self._refusals.pop(vehicle, None)
            return None
        self._forget_outdated()
        ahead = route.way[route.allocated :]
        if last := self._last_refusals.get(vehicle):
            refused: _Refused | None = last.refused
        elif refusal := self._find_stuck_on(vehicle, ahead):
            refused = _Refused(refusal, [*ahead])
        else:
            causes = {vehicle}
            refused = self._claim_section(vehicle, ahead, right_of_way, causes, more_than=claimed)
            if refused and (not right_of_way or right_of_way.vehicle not in causes):
                self._last_refusals[vehicle] = _LastRefusal(refused, frozenset(causes), right_of_way)
        if refused is None or claimed:
            self._refusals.pop(vehicle, None)
            return None
        return refused

    def _claims_enough(self, vehicle: str) -> bool:
        """Return whether a vehicle under way claims a whole section, or all of its route."""
        route, claimed = self._routes[vehicle], len(self.scheduler.occupant(vehicle).claimed)
        return claimed >= SECTION or claimed == len(route.way) - route.allocated

    def _claim_section(
        self,
        vehicle: str,
        ahead: Sequence[ResourceSet],
        right_of_way: _RightOfWay | None,
        causes: set[str],
        *,
        more_than: int = 0,
    ) -> _Refused | None:
        """Claim the longest section available; otherwise return why the longest one was refused.

        Vehicles at rest take precedence as the reason, because they can be relocated. Add to ``causes`` the
        vehicles on which this depends.
        """
        refused: _Refused | None = None
        # From the first waiting place after SECTION down: a vehicle that waits anywhere else blocks others.
        ends = list[int]()
        for end in self.resources.waiting_places(ahead):
            ends.append(end)
            if end >= SECTION:
                break
        sections = ends[::-1] or [0]
        free = self.scheduler.free_of_rest(vehicle, ahead[: sections[0]])
        for count in sections:
            if count <= more_than and (count or ahead):
                break
            if count > free and refused:
                continue
            way, refusal = list(ahead[:count]), None
            # Others may pass the section with the right of way, but not stop on it: so it becomes free.
            if right_of_way and right_of_way.vehicle != vehicle:
                resource = find_conflict(self.scheduler.end_of(vehicle, way), right_of_way.section)
                if resource:
                    refusal = Refusal(WaitReason.ORDER, (right_of_way.vehicle,), resource)
            refusal = refusal or self.scheduler.claim(vehicle, way)
            if refusal is None:
                return None
            causes.update(refusal.vehicles, refusal.between)
            refused = refused or _Refused(refusal, way)
            if refused.refusal.reason is not WaitReason.RESTING and refusal.reason is WaitReason.RESTING:
                refused = _Refused(refusal, way)
        return refused

    # Relocation of vehicles that rest in the way

    def _make_room(
        self, requester: str, refused: _Refused, right_of_way: _RightOfWay, movable: VehicleTest
    ) -> Iterator[Relocation | EarlyEnd]:
        """Relocate vehicles that rest on the requester's way, and end the routes of those that wait on it.

        A vehicle with its own request is only relocated for the right of way, or if it is cut off, or waits
        for itself through others and would never leave. The route of a vehicle under way that encloses one
        that has to be relocated ends if no other vehicle could be relocated.
        """
        has_right_of_way = right_of_way.vehicle == requester

        def may_be_sent(name: str) -> bool:
            if not movable(name) or name in self._routes:
                return False
            if name not in self._requests or has_right_of_way or self._is_cut_off(name):
                return True
            return self._waits_for_itself(name)

        blockers = refused.refusal.vehicles
        under_way = [name for name in blockers if name in self._routes]
        kept_free = [*right_of_way.section, *refused.way]
        enclosing, sent = set[str](), False
        for relocation in self._relocator.relocate(blockers, kept_free, may_be_sent, enclosing):
            sent = True
            self._refusals.pop(relocation.vehicle, None)
            if relocation.lets_out:
                at = self.scheduler.occupant(relocation.lets_out).point
                self._let_out[relocation.vehicle] = _LetOut(relocation.lets_out, at, requester)
            self._start_route(relocation.vehicle, relocation.way)
            yield relocation
        yield from (EarlyEnd(name) for name in under_way if self._waits_for_itself(name))
        for name in () if sent else sorted(enclosing.intersection(self._routes).difference(under_way)):
            refusal = self._refusals.get(name)
            # One that only pauses on its route will drive on by itself, unless it waits for one of these.
            waits = refusal is not None and not (enclosing | {requester}).isdisjoint(refusal.vehicles)
            if self.scheduler.occupant(name).resting and (has_right_of_way or waits):
                yield EarlyEnd(name)

    def _waits_for_itself(self, vehicle: str) -> bool:
        """Return whether a vehicle waits for itself through others, so that they are deadlocked."""
        reached: set[str] = set()
        open_ends = [vehicle]
        while open_ends:
            refusal = self._refusals.get(open_ends.pop())
            for name in refusal.vehicles if refusal else ():
                if name == vehicle:
                    return True
                if name not in reached:
                    reached.add(name)
                    open_ends.append(name)
        return False

    def _has_let_out(self, vehicle: str, lost: VehicleTest) -> bool:
        """Return whether the vehicle that this one let out is still there and still has to leave."""
        let_out = self._let_out.get(vehicle)
        if let_out is None:
            return False
        wanted = let_out.requester in self._requests or let_out.requester in self._refusals
        there = let_out.vehicle in self.scheduler and not lost(let_out.vehicle)
        if wanted and there and self.scheduler.occupant(let_out.vehicle).point == let_out.at:
            return True
        del self._let_out[vehicle]
        return False

    # Vehicles under way

    def allocate(
        self,
        vehicle: str,
        ahead: int = 0,
        length_mm: float = 0.0,
        gate: Gate = OPEN,
        *,
        limits: tuple[int | None, int | None] = (None, None),
    ) -> bool:
        """Allocate sets until the vehicle has enough ahead of it; return whether it may drive further.

        Enough means at least ``ahead`` sets, and ``length_mm`` beyond the next one. Without either, allocate
        as many as possible. ``limits``: numbers of sets and of mm ahead at which it has enough in any case.
        """
        most, most_mm = (inf if limit is None else limit for limit in limits)
        route, occupant = self._routes[vehicle], self.scheduler.occupant(vehicle)
        released, last_refusal = route.released, route.refusal
        route.refusal, stopped = None, False
        least = max(ahead, 1 if length_mm else 0)
        while occupant.claimed:
            if least and occupant.ahead >= least and occupant.length_behind_next_mm >= length_mm:
                break
            if occupant.ahead >= most or occupant.length_ahead_mm >= most_mm:
                break
            if stopped := not gate.may_allocate(route.allocated):
                break
            if refusal := self.scheduler.allocate(vehicle):
                route.refusal = self._with_distance(refusal, last_refusal or self._refusals.get(vehicle))
                break
            route.allocated += 1
        while route.released < route.allocated and gate.may_release(route.released):
            route.released += 1
        self._forget_outdated()
        if route.all_allocated:
            self._settled[vehicle] = frozenset((vehicle,))
        else:
            self._settled.pop(vehicle, None)
        route.holds_enough = not route.refusal and not stopped and route.released == route.allocated
        return route.released > released

    def give_back(self, vehicle: str) -> None:
        """Free the sets that are allocated to a vehicle, but that it may not drive yet; it claims them."""
        route = self._routes.get(vehicle)
        if route and route.allocated > route.released:
            self.scheduler.give_back(vehicle, route.allocated - route.released)
            route.allocated = route.released

    def replace_route(
        self, vehicle: str, steps: Sequence[Step], at_goal: Sequence[str] = ()
    ) -> Refusal | None:
        """Replace a vehicle's route beyond what is allocated; return the refusal, if any.

        The vehicle keeps what is allocated. If traffic control refuses, the route is unchanged.
        """
        route, occupant = self._routes[vehicle], self.scheduler.occupant(vehicle)
        way = self.resources.for_route(steps, start=occupant.held[-1], at_goal=at_goal)
        if refused := self._claim_section(vehicle, way, self._right_of_way, set()):
            return refused.refusal
        route.way, route.refusal = (*route.way[: route.allocated], *way), None
        self._refusals.pop(vehicle, None)
        return None

    def note_arrival(self, vehicle: str, reached: int) -> bool:
        """Note that the vehicle has arrived at the ``reached``-th set of its route, counted from 1.

        Return whether any vehicle may be able to continue because of it. A vehicle that has driven further
        than allowed also holds what it has reached.
        """
        route, occupant = self._routes[vehicle], self.scheduler.occupant(vehicle)
        reached = min(reached, len(route.way))
        # A robot that drove beyond its base holds what it covers, although nobody granted it.
        if route.allocated + len(occupant.claimed) < reached:  # beyond the section that it claims
            self.scheduler.restore_claim(vehicle, (), route.way[route.allocated : reached])
        while route.allocated < reached:
            self.scheduler.seize(vehicle)
            route.allocated += 1
        route.released = max(route.released, reached)
        if reached <= route.reached:
            return False
        freed = self.scheduler.arrive(vehicle, occupant.reached + reached - route.reached)
        route.reached = reached
        return freed or not route.all_allocated

    def finish_route(self, vehicle: str) -> None:
        """Note that the vehicle has arrived at the end of its route and is at rest."""
        self.note_arrival(vehicle, len(self._routes[vehicle].way))
        del self._routes[vehicle]
        self._refusals.pop(vehicle, None)
        # A route may end early, to make room: only at its goal the vehicle gives up its turn.
        at_goal = self._turns.get(vehicle, (0, ""))[1] == self.scheduler.occupant(vehicle).point
        if at_goal and vehicle not in self._requests:
            self._turns.pop(vehicle, None)

    def revoke_route(self, vehicle: str, *, again: bool = False) -> None:
        """Withdraw a route of which nothing is released yet; the vehicle stays at rest.

        ``again``: request the route again, unless the vehicle was only to be relocated.
        """
        self.give_back(vehicle)
        route_request = self._routes.pop(vehicle).route_request
        self.scheduler.give_up_claim(vehicle)
        if again and route_request:
            self.request_route(route_request, first=True)

    def shorten_route(self, vehicle: str) -> None:
        """End a vehicle's route at the last set that it may drive."""
        self.give_back(vehicle)
        route = self._routes[vehicle]
        self.scheduler.give_up_claim(vehicle)
        route.way, route.refusal = route.way[: route.allocated], None
        self._refusals.pop(vehicle, None)

    def break_off(self, vehicle: str) -> None:
        """Break off a route: the vehicle keeps everything it may drive until it is seen standing."""
        self.give_back(vehicle)
        occupant = self.scheduler.occupant(vehicle)
        held = tuple(occupant.held)
        self._routes.pop(vehicle, None)
        self._refusals.pop(vehicle, None)
        # The robot stops somewhere between the point it reached last and the next one.
        self._broken_off[vehicle] = held[: occupant.reached + 2]
        self.scheduler.place_at_rest(vehicle, held, occupant.length_mm)

    def resume_route(self, vehicle: str, way: Sequence[ResourceSet], allocated: int) -> None:
        """Restore a vehicle's route after a restart; :meth:`note_arrival` then reports its progress."""
        self._broken_off.pop(vehicle, None)
        # The claim ends at a waiting place again, as it did before the restart (decision 0038).
        ends = self.resources.waiting_places(way)
        end = next((place for place in ends if place >= allocated), allocated)
        self.scheduler.restore_claim(vehicle, way[:allocated], way[allocated:end])
        self._routes[vehicle] = AllocatedRoute(tuple(way), allocated, released=allocated)
