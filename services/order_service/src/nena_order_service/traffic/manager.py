"""Traffic manager: which resources each vehicle holds, and how far it may drive on its granted route."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import count
from math import inf
from typing import Protocol, TypeVar

from nena_order_service.routing.graph import Route, Step
from nena_order_service.routing.router import VehicleRoutes
from nena_order_service.traffic.evasion import Evasion, no_vehicle
from nena_order_service.traffic.resources import Found, OccupancyFinder, Resources, ResourceSet
from nena_order_service.traffic.route_search import Journey, RouteRequest
from nena_order_service.traffic.scheduler import Refusal, WaitReason
from nena_order_service.traffic.traffic_control import (
    Displacement,
    MoreClaimed,
    RouteGrant,
    RouteRejection,
    TrafficControl,
)
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import PlantModel
from nena_shared.plant.track import BoundingBox

R = ReasonCode

D = TypeVar("D", bound=RouteGrant | Evasion)


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


class TrafficManager:
    """Manages the resources that vehicles hold in one plant; vehicles are identified by name.

    A vehicle at rest is *seen* at a position. It *requests* a route, which :meth:`decide` grants. The route's
    resource sets are *allocated* in driving order (openTCS: allocation). A set is freed once the vehicle has
    *arrived* at a later one and its length no longer covers it. A vehicle that breaks off its route keeps
    everything it held until it is seen standing. A resource is never allocated to two vehicles; only vehicles
    that were found at the same position share one.
    """

    def __init__(
        self, plant: PlantModel, ways: VehicleRoutes, *, exclusive: bool = True, peripherals: bool = True
    ) -> None:
        """``peripherals``: whether vehicles need the peripheral devices of their paths."""
        self.resources = Resources(plant, exclusive=exclusive, peripherals=peripherals)
        self._control = TrafficControl(plant, ways, self.resources)
        self._occupancy = OccupancyFinder(plant, self.resources)
        self._journeys = self._control.journeys
        self._scheduler = self._control.scheduler
        self._broken_off: dict[str, tuple[ResourceSet, ...]] = {}
        """The resource sets where vehicles may be that broke off their routes or are moved by hand, up to the
        next point of their routes."""
        self._turn_backs: dict[str, tuple[tuple[WaitReason, tuple[str, ...], str], int]] = {}
        """By vehicle: why it waits, and how far (mm) the other one would have had to turn back initially."""
        self._left_at: dict[str, tuple[ResourceSet, ...]] = {}
        """The same for vehicles that have since been seen standing beside a point, until they are on one or
        drive on. Their pose alone may wrongly show them clear of a curved path."""
        self._to_extend: dict[str, int] = {}
        """Vehicles whose routes may be only partly allocated, with their places in :meth:`extending`."""
        self._numbers = count()
        self._unsettled: set[str] = set()
        """Vehicles for which something may have changed since they were last settled."""
        self._woken_by: dict[str, set[str]] = {}
        """By vehicle: those that remain settled until it changes."""
        self._enough: dict[str, tuple[int, int]] = {}
        """By vehicle: when it last held enough; see :meth:`holds_enough`."""
        self._halted: frozenset[str] = frozenset()
        """Vehicles to which nothing is allocated for now; see :meth:`halt`."""

    def __contains__(self, vehicle: str) -> bool:
        """Return whether the vehicle holds anything."""
        return vehicle in self._scheduler

    def held(self, vehicle: str) -> tuple[ResourceSet, ...]:
        """Return what a vehicle holds, oldest first; empty for an unknown vehicle."""
        return tuple(self._scheduler.occupant(vehicle).held) if vehicle in self._scheduler else ()

    def point(self, vehicle: str) -> str:
        """Return the point that a vehicle has reached last; raises UnknownOccupantError."""
        return self._scheduler.occupant(vehicle).point

    def users(self, resource: str) -> frozenset[str]:
        """Return the vehicles that hold, claim or will rest on a point, path, block or location."""
        return self._scheduler.users(resource)

    def holders(self, resource: str) -> frozenset[str]:
        """Return the vehicles that hold a point, path, block, location or peripheral device."""
        return self._scheduler.holders(resource)

    def stands(self, vehicle: str, point: str, *, on_point: bool) -> bool:
        """Return whether the vehicle is on this point or, unless ``on_point``, nearest to it."""
        occupant = self._scheduler.occupant(vehicle)
        return occupant.point == point and (occupant.entry is None) == on_point

    def journey(self, vehicle: str) -> Journey | None:
        """Return the vehicle's route, read-only; None if it is at rest."""
        return self._journeys.get(vehicle)

    def seen(self, vehicle: str, found: Found, box: BoundingBox, *, moving: bool = False) -> bool:
        """Make a vehicle without a route hold the resources at the position where it was seen.

        Return whether that changes what it holds.

        While it is ``moving`` it also keeps what it held before. After a completed route, the route shows
        more precisely than the pose what the vehicle's length covers. After a route that was broken off, the
        vehicle also keeps the resources next to its last position, because paths may be curved.
        """
        beside = self.beside(vehicle)
        footing, behind = self._occupancy.of(found, box), self._behind(vehicle, found, moving=moving)
        if behind and behind[-1].point == found.point and found.on_point and not moving:
            held, entry = behind, None
        else:
            held = (*(each for each in behind if each != footing.under), footing.under)
            entry = footing.entry
        if moving:
            self._broken_off.setdefault(vehicle, self.held(vehicle) if self._is_at(vehicle, found) else ())
        else:
            remembered = self._broken_off.pop(vehicle, None)
            if found.on_point:
                self._left_at.pop(vehicle, None)
            elif remembered is not None:
                self._left_at[vehicle] = remembered
        if vehicle in self._scheduler:
            occupant = self._scheduler.occupant(vehicle)
            if tuple(occupant.held) == held and occupant.entry == entry:
                return beside != self.beside(vehicle)
        self._scheduler.place(vehicle, held, box.length_mm, entry=entry)
        return True

    def _is_at(self, vehicle: str, found: Found) -> bool:
        return vehicle in self._scheduler and self._scheduler.occupant(vehicle).point == found.point

    def _behind(self, vehicle: str, found: Found, *, moving: bool) -> tuple[ResourceSet, ...]:
        """Return those of a vehicle's held sets that it still covers at the position where it was found."""
        held = self.held(vehicle)
        if moving:
            return held
        remembered = self.beside(vehicle)
        passed = held if remembered is None else remembered
        if found.on_point:
            at = [index for index, each in enumerate(passed) if each.point == found.point]
            return passed[: at[-1] + 1] if at else ()
        return () if remembered is None else passed

    def beside(self, vehicle: str) -> tuple[ResourceSet, ...] | None:
        """Return what a vehicle that broke off may occupy; None: it did not, or has been seen on a point."""
        return self._broken_off.get(vehicle, self._left_at.get(vehicle))

    def restore(
        self,
        vehicle: str,
        held: Sequence[ResourceSet],
        length_mm: int,
        *,
        beside: tuple[ResourceSet, ...] | None = None,
    ) -> None:
        """Restore what a vehicle held before a restart; with ``beside`` it must be seen standing first."""
        self._scheduler.place(vehicle, held, length_mm)
        if beside is not None:
            self._broken_off[vehicle] = beside

    def resume(self, vehicle: str, way: Sequence[ResourceSet], allocated: int) -> None:
        """Restore a vehicle's route after a restart; :meth:`arrived` then reports its progress."""
        self._broken_off.pop(vehicle, None)
        ends = self.resources.waiting_places(way)
        end = next((each for each in ends if each >= allocated), allocated)
        self._scheduler.resume(vehicle, way[:allocated], way[allocated:end])
        self._journeys[vehicle] = Journey(tuple(way), allocated, released=allocated)
        self._extend(vehicle)

    def remove(self, vehicle: str) -> None:
        """Remove a vehicle: it no longer holds, requests or claims anything."""
        self._control.forget(vehicle)
        self._unsettled.add(vehicle)
        self._turn_backs.pop(vehicle, None)
        self._enough.pop(vehicle, None)
        self._journeys.pop(vehicle, None)
        self._broken_off.pop(vehicle, None)
        self._left_at.pop(vehicle, None)
        self._scheduler.remove(vehicle)

    def request_route(self, route_request: RouteRequest, *, first: bool = False) -> None:
        """Handle the route request of a resting vehicle; see :meth:`TrafficControl.request_route`."""
        self._control.request_route(route_request, first=first)

    def drop(self, vehicle: str) -> None:
        """Drop a vehicle's request."""
        self._control.drop(vehicle)

    def forget_routes(self) -> None:
        """Drop the cached routes of waiting vehicles, because the plant has changed."""
        self._control.forget_routes()
        self._unsettled.update(self._to_extend)

    def recheck(self) -> None:
        """Answer all requests again, also those whose reasons to wait still hold."""
        self._control.forget_answers()

    def displaces(self, vehicle: str, goal: str) -> bool:
        """Return whether vehicles at rest, now or soon, would have to make room for a drive to ``goal``."""
        return self._control.displaces(RouteRequest(vehicle, goal))

    def decide(
        self,
        movable: Callable[[str], bool],
        lost: Callable[[str], bool] = no_vehicle,
        searches: float = inf,
    ) -> Iterator[RouteGrant | Evasion | RouteRejection | Displacement | MoreClaimed]:
        """Grant routes to vehicles; see :meth:`TrafficControl.decide`."""
        for each in self._control.decide(movable, lost, [name for name, _ in self.extending()], searches):
            yield self._departed(each) if isinstance(each, RouteGrant | Evasion) else each

    @property
    def unfinished(self) -> bool:
        """Whether the last decision reached its search limit before it had handled every vehicle."""
        return self._control.unfinished

    def halt(self, vehicles: Collection[str]) -> None:
        """Allocate nothing more to these vehicles, and resume allocation to all others."""
        self._halted = frozenset(vehicles)

    def stuck(self, movable: Callable[[str], bool], lost: Callable[[str], bool]) -> Iterator[str]:
        """Yield the driving vehicles that wait for vehicles at rest which will not make room.

        Those cannot be moved, or it is unknown when they can. Call this after :meth:`decide`.
        """
        for vehicle, journey in self.extending():
            if self.is_blocked(vehicle) and journey.refusal:
                blockers = [each for each in journey.refusal.vehicles if each not in self._journeys]
                if blockers and all(movable(each) or lost(each) for each in blockers):
                    yield vehicle
            elif self._scheduler.occupant(vehicle).resting and self._waits_for(vehicle, lost):
                yield vehicle

    def _waits_for(self, vehicle: str, lost: Callable[[str], bool]) -> bool:
        why = self._control.why_waiting(vehicle)
        return why is not None and why.reason is WaitReason.RESTING and any(map(lost, why.vehicles))

    def _departed(self, granted: D) -> D:
        self._left_at.pop(granted.vehicle, None)
        self._journeys[granted.vehicle] = Journey(granted.way)
        self._extend(granted.vehicle)
        return granted

    def replan(self, vehicle: str, steps: Sequence[Step], at_goal: Sequence[str] = ()) -> Refusal | None:
        """Replace a vehicle's route beyond what is allocated; return the refusal, if any.

        The vehicle keeps what is allocated. If traffic control refuses, the route is unchanged.
        """
        journey, occupant = self._journeys[vehicle], self._scheduler.occupant(vehicle)
        way = self.resources.way(steps, start=occupant.held[-1], at_goal=at_goal)
        refusal = self._control.claim_other_way(vehicle, way)
        if refusal is None:
            journey.way, journey.refusal = (*journey.way[: journey.allocated], *way), None
            self._control.forget_refusal(vehicle)
            self._extend(vehicle)
        return refusal

    def route_around(
        self,
        vehicle: str,
        avoid: Collection[str] = frozenset(),
        stays: Callable[[str], bool] = lambda _: True,
    ) -> Route | None:
        """Return a route with less traffic for a waiting vehicle; see :meth:`TrafficControl.route_around`."""
        return self._control.route_around(vehicle, self.waiting_at_end(), avoid, stays)

    def waiting_at_end(self) -> dict[str, int]:
        """Return the vehicles that wait at the end of what they hold, and how far each has driven."""
        return {
            name: journey.reached
            for name, journey in self.extending()
            if journey.refusal and not self._scheduler.occupant(name).ahead
        }

    def revoke(self, vehicle: str) -> None:
        """Withdraw a route of which nothing is released yet; the vehicle stays at rest."""
        self.give_back(vehicle)
        self._journeys.pop(vehicle)
        self._unsettled.add(vehicle)
        self._scheduler.give_up_claim(vehicle)

    def give_back(self, vehicle: str) -> None:
        """Free the sets that are allocated to a vehicle, but that it may not drive yet; it claims them."""
        journey = self._journeys.get(vehicle)
        if journey and journey.allocated > journey.released:
            self._scheduler.give_back(vehicle, journey.allocated - journey.released)
            journey.allocated = journey.released
            self._extend(vehicle)

    def allocate(
        self,
        vehicle: str,
        ahead: int = 0,
        length_mm: float = 0.0,
        gate: Gate = OPEN,
    ) -> bool:
        """Allocate sets until the vehicle has enough ahead of it; return whether it may drive further.

        Enough means at least ``ahead`` sets, and ``length_mm`` beyond the next one. Without either, allocate
        as many as possible.
        """
        if vehicle in self._halted:
            return False
        journey, occupant = self._journeys[vehicle], self._scheduler.occupant(vehicle)
        before = journey.released
        self._unsettled.add(vehicle)
        journey.refusal, stopped = None, False
        least = max(ahead, 1 if length_mm else 0)
        while occupant.claimed:
            if least and occupant.ahead >= least and occupant.length_behind_next_mm >= length_mm:
                break
            if stopped := not gate.may_allocate(journey.allocated):
                break
            journey.refusal = self._scheduler.allocate(vehicle)
            if journey.refusal:
                break
            journey.allocated += 1
        while journey.released < journey.allocated and gate.may_release(journey.released):
            journey.released += 1
        if journey.refusal is None and not stopped and journey.released == journey.allocated:
            self._enough[vehicle] = self._moment(vehicle)
        return journey.released > before

    def holds_enough(self, vehicle: str) -> bool:
        """Return whether a vehicle has not changed since :meth:`allocate` left nothing to allocate."""
        return self._enough.get(vehicle) == self._moment(vehicle)

    def _moment(self, vehicle: str) -> tuple[int, int]:
        """Return numbers that change with what a vehicle holds and claims, and how far it has driven."""
        return self._scheduler.version(vehicle), self._journeys[vehicle].reached

    def is_blocked(self, vehicle: str) -> bool:
        """Return whether a vehicle at rest blocks this one on its route."""
        journey = self._journeys.get(vehicle)
        refusal = journey.refusal if journey else None
        return refusal is not None and refusal.reason is WaitReason.RESTING

    def ahead(self, vehicle: str) -> int:
        """Return how many sets a vehicle holds ahead of it; raises UnknownOccupantError."""
        return self._scheduler.occupant(vehicle).ahead

    def arrived(self, vehicle: str, reached: int) -> bool:
        """Note that the vehicle has arrived at the ``reached``-th set of its route, counted from 1.

        Return whether any vehicle may be able to continue because of it. A vehicle that has driven further
        than allowed also holds what it has reached.
        """
        journey, occupant = self._journeys[vehicle], self._scheduler.occupant(vehicle)
        self._unsettled.add(vehicle)
        reached = min(reached, len(journey.way))
        if journey.allocated + len(occupant.claimed) < reached:  # beyond the section that it claims
            self._scheduler.resume(vehicle, (), journey.way[journey.allocated : reached])
        while journey.allocated < reached:
            self._scheduler.seize(vehicle)
            journey.allocated += 1
        journey.released = max(journey.released, reached)
        if reached <= journey.reached:
            return False
        freed = self._scheduler.arrive(vehicle, occupant.reached + reached - journey.reached)
        journey.reached = reached
        return freed or not journey.all_allocated

    def finished(self, vehicle: str) -> None:
        """Note that the vehicle has arrived at the end of its route and is at rest."""
        self.arrived(vehicle, len(self._journeys[vehicle].way))
        del self._journeys[vehicle]
        self._control.end_turn(vehicle, self._scheduler.occupant(vehicle).point)

    def shorten(self, vehicle: str) -> None:
        """End a vehicle's route at the last set that it may drive."""
        self.give_back(vehicle)
        journey = self._journeys[vehicle]
        self._scheduler.give_up_claim(vehicle)
        journey.way, journey.refusal = journey.way[: journey.allocated], None
        self._unsettled.add(vehicle)
        self._control.forget_refusal(vehicle)

    def break_off(self, vehicle: str) -> None:
        """Break off a route: the vehicle keeps everything it may drive until it is seen standing."""
        self.give_back(vehicle)
        occupant = self._scheduler.occupant(vehicle)
        held = tuple(occupant.held)
        self._journeys.pop(vehicle, None)
        self._control.forget_refusal(vehicle)
        self._broken_off[vehicle] = held[: occupant.reached + 2]
        self._scheduler.place(vehicle, held, occupant.length_mm)

    def broke_off(self, vehicle: str) -> bool:
        """Return whether a vehicle broke off or moved without a route, and was not seen standing since."""
        return vehicle in self._broken_off

    def extending(self) -> list[tuple[str, Journey]]:
        """Return the driving vehicles to which more may be allocated, with their routes.

        The others, of which there may be many, need no traffic control for now: their whole routes are
        allocated, or they hold and claim enough until they or the vehicles ahead of them change.
        """
        for name in self._scheduler.take_changed():
            self._unsettled.add(name)
            self._unsettled.update(self._woken_by.pop(name, ()))
        found: list[tuple[str, Journey]] = []
        if not self._to_extend:
            self._unsettled.clear()
            return found
        for name in sorted(self._unsettled & self._to_extend.keys(), key=self._to_extend.__getitem__):
            journey = self._journeys.get(name)
            if journey is None or journey.all_allocated:
                del self._to_extend[name]
            elif not self._is_settled(name, journey):
                found.append((name, journey))
        self._unsettled = {name for name, _ in found}
        return found

    def _extend(self, vehicle: str) -> None:
        """Serve a vehicle whose route may be only partly allocated, after the others."""
        if vehicle not in self._to_extend:
            self._to_extend[vehicle] = next(self._numbers)
        self._unsettled.add(vehicle)

    def _is_settled(self, vehicle: str, journey: Journey) -> bool:
        """Return whether a vehicle can neither be allocated nor claim more now; if so, await changes."""
        if journey.refusal or not self.holds_enough(vehicle):
            return False
        causes = self._control.claims_enough_until(vehicle)
        for each in causes or ():
            self._woken_by.setdefault(each, set()).add(vehicle)
        return causes is not None

    @property
    def waiting(self) -> frozenset[str]:
        """The vehicles that may be waiting for traffic, under way or before departure."""
        return frozenset((*(name for name, _ in self.extending()), *self._control.requesting))

    def why_waiting(self, vehicle: str) -> str:
        """Return why a vehicle waits for traffic; empty if it does not."""
        refusal = self.refusal(vehicle)
        if refusal is None:
            self._turn_backs.pop(vehicle, None)
            return ""
        return refusal.in_words(self.turn_back_mm(vehicle, refusal))

    def refusal(self, vehicle: str) -> Refusal | None:
        """Return the refusal for which a vehicle waits; None if it does not wait for traffic."""
        journey = self._journeys.get(vehicle)
        return (journey and journey.refusal) or self._control.why_waiting(vehicle)

    def turn_back_mm(self, vehicle: str, refusal: Refusal) -> int:
        """Return how far the other vehicle would have to turn back, mm; see :class:`Scheduler`.

        The value from when ``vehicle`` began to wait is cached. The current one changes with each node, and
        each change of a vehicle's status is stored and published.
        """
        cause = refusal.reason, refusal.vehicles, refusal.resource
        cached = self._turn_backs.get(vehicle)
        if cached is None or cached[0] != cause:
            known = bool(refusal.way) and refusal.vehicles[0] in self._scheduler
            cached = self._turn_backs[vehicle] = cause, self._scheduler.turn_back_mm(refusal) if known else 0
        return cached[1]

    def sharing(self, vehicle: str) -> str:
        """Return, as a predicate, which vehicle stands on the same resource; empty if there is none."""
        found = self._scheduler.sharing(vehicle) if vehicle in self._scheduler else None
        return Reason(R.SHARES, at=found[1], vehicle=found[0]) if found else ""
