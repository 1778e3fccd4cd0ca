"""Choose vehicles for orders: the rules of the settings, the cheapest assignment, and why orders wait."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from heapq import heappop, heappush, nsmallest
from itertools import groupby, takewhile
from math import inf
from types import MappingProxyType
from typing import Final, Protocol

from nena_order_service.dispatching.candidates import DispatchedVehicle, OrderKind, kind_of
from nena_order_service.dispatching.settings import (
    CandidateKey,
    Chooser,
    DispatchSettings,
    OrderKey,
    VehicleKey,
)
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.routing.router import RouteCost
from nena_shared.fleet_api.reasons import Reason, ReasonCode

R = ReasonCode

Rank = tuple[float | str, ...]
"""Sort key; lower values are served first."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A vehicle that could execute an order now, and its cost."""

    order: TransportOrder
    vehicle: DispatchedVehicle
    cost: RouteCost


@dataclass(frozen=True, slots=True)
class Now:
    """Time of a comparison, and how close to its deadline an order is at risk."""

    time: datetime
    at_risk: timedelta

    def risks(self, order: TransportOrder) -> bool:
        """Whether an order's deadline is at risk."""
        deadline = order.status.deadline
        return deadline is not None and deadline <= self.time + self.at_risk


def _deadline(order: TransportOrder) -> float:
    deadline = order.status.deadline
    return deadline.timestamp() if deadline else inf


ORDER_VALUES: Final[Mapping[OrderKey, Callable[[TransportOrder, Now], float | str]]] = MappingProxyType(
    {
        OrderKey.BY_PRIORITY: lambda order, _: -order.status.priority,
        OrderKey.BY_DEADLINE: lambda order, _: _deadline(order),
        OrderKey.DEADLINE_AT_RISK_FIRST: lambda order, now: not now.risks(order),
        OrderKey.BY_AGE: lambda order, _: order.number,
        OrderKey.BY_NAME: lambda order, _: order.name,
    }
)

VEHICLE_VALUES: Final[Mapping[VehicleKey, Callable[[DispatchedVehicle], float | str]]] = MappingProxyType(
    {
        VehicleKey.BY_ENERGY_LEVEL: lambda vehicle: -vehicle.energy,
        VehicleKey.IDLE_FIRST: lambda vehicle: not vehicle.idle,
        VehicleKey.BY_NAME: lambda vehicle: vehicle.name,
    }
)

CANDIDATE_VALUES: Final[Mapping[CandidateKey, Callable[[Candidate, Now], float | str]]] = MappingProxyType(
    {
        CandidateKey.BY_COMPLETE_ROUTING_COSTS: lambda pair, _: pair.cost.complete,
        CandidateKey.BY_INITIAL_ROUTING_COSTS: lambda pair, _: pair.cost.initial,
        CandidateKey.BY_ORDER_TYPE_PRIORITY: lambda pair, _: pair.vehicle.type_priority(pair.order),
        CandidateKey.BY_PRIORITY: lambda pair, _: -pair.order.status.priority,
        CandidateKey.BY_DEADLINE: lambda pair, _: _deadline(pair.order),
        CandidateKey.DEADLINE_AT_RISK_FIRST: lambda pair, now: not now.risks(pair.order),
        CandidateKey.BY_AGE: lambda pair, _: pair.order.number,
        CandidateKey.BY_ORDER_NAME: lambda pair, _: pair.order.name,
        CandidateKey.BY_ENERGY_LEVEL: lambda pair, _: -pair.vehicle.energy,
        CandidateKey.IDLE_FIRST: lambda pair, _: not pair.vehicle.idle,
        CandidateKey.BY_VEHICLE_NAME: lambda pair, _: pair.vehicle.name,
    }
)


def rank_orders(keys: Sequence[OrderKey], now: Now) -> Callable[[TransportOrder], Rank]:
    """Return the sort key of orders; orders that are equal in all ``keys`` are sorted by age."""
    values = [ORDER_VALUES[key] for key in keys]
    return lambda order: (*(value(order, now) for value in values), order.number)


def rank_vehicles(keys: Sequence[VehicleKey]) -> Callable[[DispatchedVehicle], Rank]:
    """Return the sort key of vehicles; vehicles that are equal in all ``keys`` are sorted by name."""
    values = [VEHICLE_VALUES[key] for key in keys]
    return lambda vehicle: (*(value(vehicle) for value in values), vehicle.name)


def rank_candidates(keys: Sequence[CandidateKey], now: Now) -> Callable[[Candidate], Rank]:
    """Return the sort key of pairs; pairs that are equal in all ``keys`` are sorted by vehicle, then age."""
    values = [CANDIDATE_VALUES[key] for key in keys]
    return lambda pair: (*(value(pair, now) for value in values), pair.vehicle.name, pair.order.number)


Costs = Mapping[str, int]
"""Cost of each vehicle that could execute the order, at least 0."""


def assign(levels: Sequence[Mapping[int, Costs]]) -> dict[int, str]:
    """Return the cheapest vehicles by the numbers of their orders; each vehicle gets at most one order.

    Each level is served before the later ones: as many of its orders as possible, and never fewer for the
    sake of a later level or the cost. Within a level, the choice of orders and vehicles minimises the total
    cost. On equal cost, earlier orders keep the cheaper vehicle.

    Successive shortest augmenting paths with potentials, after Jonker and Volgenant (1987), over the feasible
    pairs: each added order gets a vehicle, and others may change theirs for it. Costs are integers, so
    rounding loses nothing.
    """
    vehicles = {name for level in levels for costs in level.values() for name in costs}
    if len(vehicles) == 1:
        return _nearest(levels, vehicles.pop())
    search = _Search(levels)
    for level in levels:
        search.add(level)
    return search.found


def _nearest(levels: Sequence[Mapping[int, Costs]], vehicle: str) -> dict[int, str]:
    """Return the order of the first level that the only vehicle can execute at the lowest cost."""
    for level in levels:
        if costs := {order: each[vehicle] for order, each in level.items() if each}:
            return {min(costs, key=costs.__getitem__): vehicle}
    return {}


Place = str | int
"""A vehicle by its name, or an order's number: the order is left out."""


class _Search:
    """A matching that grows by one order at a time and is optimal after each step."""

    def __init__(self, levels: Sequence[Mapping[int, Costs]]) -> None:
        self._left_out = 1 + sum(
            max(costs.values(), default=0) for level in levels for costs in level.values()
        )
        """Cost of leaving out an order of the current level: more than any detour that avoids it."""
        self._costs: dict[int, dict[Place, int]] = {}
        self._order_of: dict[Place, int] = {}
        self._place_of: dict[int, Place] = {}
        self._of_orders: dict[int, int] = {}
        """Potentials: the sum of both potentials of a pair is at most its cost."""
        self._of_places: dict[Place, int] = {}

    @property
    def found(self) -> dict[int, str]:
        """The vehicles by the orders assigned to them."""
        return {order: place for order, place in self._place_of.items() if isinstance(place, str)}

    def add(self, level: Mapping[int, Costs]) -> None:
        """Add the orders of a level; orders left out stay left out, the others stay assigned."""
        for order, costs in level.items():
            self._costs[order] = dict[Place, int](costs.items()) | {order: self._left_out}
            self._of_orders[order] = 0
            self._augment(order)
        for order in level:
            if order in self._order_of:
                del self._order_of[order], self._place_of[order], self._costs[order]
            else:
                del self._costs[order][order]

    def _augment(self, new: int) -> None:
        """Assign the cheapest vehicle to an order; other orders change theirs if that costs less."""
        reached: dict[Place, int] = {}
        by: dict[Place, int] = {}
        heap: list[tuple[int, int, Place]] = []
        settled: dict[Place, None] = {}
        order: int | None = new
        distance = pushed = 0
        while order is not None:
            known = distance - self._of_orders[order]
            for place, cost in self._costs[order].items():
                length = known + cost - self._of_places.get(place, 0)
                if place not in settled and (place not in reached or length < reached[place]):
                    reached[place], by[place] = length, order
                    heappush(heap, (length, pushed, place))
                    pushed += 1
            distance, _, end = heappop(heap)  # there is one: an order that is new can be left out
            while end in settled:
                distance, _, end = heappop(heap)
            settled[end] = None
            order = self._order_of.get(end)
        self._of_orders[new] += distance
        for place in settled:
            change = distance - reached[place]
            self._of_places[place] = self._of_places.get(place, 0) - change
            if (taken_by := self._order_of.get(place)) is not None:
                self._of_orders[taken_by] += change
        while True:
            order = by[end]
            before = self._place_of.get(order)
            self._order_of[end], self._place_of[order] = order, end
            if before is None:
                return
            end = before


BUSY: Final = Reason(R.BUSY)
NOT_INTENDED: Final = Reason(R.NOT_INTENDED)

ROUTING_COSTS: Final = (CandidateKey.BY_COMPLETE_ROUTING_COSTS, CandidateKey.BY_INITIAL_ROUTING_COSTS)
"""Keys by which pairs have costs that can be added up."""

SINGLE_OUT: Final = (OrderKey.BY_DEADLINE, OrderKey.BY_AGE, OrderKey.BY_NAME)
"""Keys that are rarely equal for two orders."""

COST_STEPS: Final = 1000
"""Integer steps per unit of cost."""

RANKS: Final = 1024
"""Maximum number of vehicles of equal cost that further keys distinguish."""

URGENCY: Final = (OrderKey.BY_PRIORITY, OrderKey.BY_DEADLINE, OrderKey.BY_AGE)
"""The keys combined in :attr:`TransportOrder.urgency`."""

KINDS_NAMED: Final = 5
"""Maximum number of kinds of obstacles named in a reason."""

NOTHING_KEPT: Final[Mapping[int, str]] = MappingProxyType({})
NONE_LEFT_OUT: Final[Mapping[int, int]] = MappingProxyType({})


class Knowledge(Protocol):
    """Queries of the dispatcher about orders and vehicles."""

    def why_unsuitable(self, order: TransportOrder, vehicle: str) -> str:
        """Return why a vehicle must not execute an order, regardless of its current work; empty if it may.

        The answer is the same for all orders of one :class:`OrderKind`.
        """
        ...

    def recharges(self, order: TransportOrder) -> bool:
        """Return whether the next operation of an order is to recharge."""
        ...

    def pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None: nothing, or it drops something before."""
        ...

    def cost(self, order: TransportOrder, vehicle: str) -> RouteCost:
        """Return the cost of a vehicle's route through an order's destinations; infinity: no route."""
        ...

    def crowd(self, order: TransportOrder) -> int:
        """Return how often vehicles will still visit the order's destinations for other orders."""
        ...

    def why_no_route(self, order: TransportOrder, vehicle: str) -> str:
        """Return why there is no route."""
        ...


@dataclass(frozen=True, slots=True)
class Assignment:
    """One order for one vehicle."""

    order: TransportOrder
    vehicle: str
    why: str
    """Why this vehicle was chosen."""
    gives_up: str = ""
    """Name of the dispensable order that the vehicle must give up first; empty if none."""


@dataclass(slots=True)
class Decisions:
    """Assignments to make now, and the reasons why other orders wait."""

    assignments: list[Assignment] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    """Wait reason of each unassigned order by name; the text stays the same while the reason holds."""


@dataclass(frozen=True, slots=True)
class Dispatcher:
    """Decides by the rules of its settings."""

    settings: DispatchSettings

    @property
    def by_urgency(self) -> bool:
        """Whether orders are sorted by urgency, so that those behind the first ones need not be examined."""
        return tuple(self.settings.orders) == URGENCY and self.settings.choosers is not Chooser.SCARCER

    @property
    def by_cost(self) -> bool:
        """Whether orders choose vehicles by complete costs, so that only as many near ones are compared."""
        first = self.settings.vehicle_candidates[0]
        return (
            first is CandidateKey.BY_COMPLETE_ROUTING_COSTS and self.settings.choosers is not Chooser.SCARCER
        )

    def decide(
        self,
        orders: Iterable[TransportOrder],
        vehicles: Iterable[DispatchedVehicle],
        knowledge: Knowledge,
        *,
        now: datetime,
        kept: Mapping[int, str] = NOTHING_KEPT,
        left_out: Mapping[int, int] = NONE_LEFT_OUT,
    ) -> Decisions:
        """Assign as many of the dispatchable ``orders``, sorted by urgency, as possible.

        ``kept`` maps order numbers to vehicles that give up dispensable orders for them; only these vehicles
        get these orders. ``left_out`` has the numbers of free vehicles that could execute an order, but are
        not among ``vehicles`` because enough others are nearer. An order is never assigned to two vehicles,
        nor two orders to one vehicle.
        """
        settings = self.settings
        moment = Now(now, timedelta(seconds=settings.deadline_at_risk))
        waiting = self._sorted(orders, moment, kept)
        found = _Round(settings, {each.name: each for each in vehicles}, knowledge, moment, kept)
        found.left_out = left_out
        if settings.choosers is Chooser.SCARCER and found.free < len(waiting):
            found.let_vehicles_choose(waiting)
        together = settings.choosers is Chooser.TOGETHER and settings.vehicle_candidates[0] in ROUTING_COSTS
        if together and (len(waiting) > 1 or found.soon):  # otherwise there is nothing to weigh up
            found.assign_together(waiting)
        found.let_orders_choose(waiting)
        return found.decisions

    def _sorted(
        self, orders: Iterable[TransportOrder], now: Now, kept: Mapping[int, str]
    ) -> Sequence[TransportOrder]:
        """Return the orders in the order in which they choose; those with reserved vehicles come first."""
        by_urgency = tuple(self.settings.orders) == URGENCY
        waiting = [*orders] if by_urgency else sorted(orders, key=rank_orders(self.settings.orders, now))
        return sorted(waiting, key=lambda order: order.number not in kept) if kept else waiting


class _Choices:
    """The vehicles that could execute one order."""

    def __init__(self, pairs: Sequence[Candidate], free: int, key: CandidateKey, dearer: float) -> None:
        """Store pairs, the best first, and the share by which others at its destinations make it ``dearer``.

        The pairs may contain only the nearest of the ``free`` vehicles.
        """
        self.pairs = {each.vehicle.name: each for each in pairs}
        self.nearest, self.free = pairs[0], free
        complete = key is CandidateKey.BY_COMPLETE_ROUTING_COSTS
        own = min(each.cost.complete - each.cost.initial for each in pairs) if complete else 0.0
        values = (each.cost.complete if complete else each.cost.initial for each in pairs)
        self.costs = {
            each.vehicle.name: round((value - own + dearer * each.cost.complete) * COST_STEPS) * RANKS
            + min(place, RANKS - 1)
            for place, (each, value) in enumerate(zip(pairs, values, strict=True))
        }
        """Each vehicle's cost beyond the order's own route, which is the same for all."""

    def why(self, best: Candidate) -> str:
        """Return why an order gets a vehicle that is not the nearest one."""
        return Reason(R.ASSIGNED_LEAST_DRIVING, cost=best.cost.complete, count=self.free)


class _Round:
    """A decision in progress."""

    def __init__(
        self,
        settings: DispatchSettings,
        vehicles: dict[str, DispatchedVehicle],
        knowledge: Knowledge,
        now: Now,
        kept: Mapping[int, str],
    ) -> None:
        self.decisions = Decisions()
        self.left_out = NONE_LEFT_OUT
        """Numbers of further free vehicles that could execute an order, by its number."""
        self._settings = settings
        self._vehicles = vehicles
        self._knowledge = knowledge
        self._now = now
        self._kept = kept
        self._assigned: set[int] = set()
        self._kinds: dict[int, OrderKind] = {}
        self._restricted = any(each.restriction for each in vehicles.values())
        self._loaded = any(each.carried for each in vehicles.values())
        self.soon = {each.name: replace(each, obstacle="") for each in vehicles.values() if each.soon}
        """Vehicles that will soon be free, in the state they will have then."""

    @property
    def free(self) -> int:
        """Return the number of vehicles that take orders."""
        return sum(not each.obstacle for each in self._vehicles.values())

    def let_vehicles_choose(self, orders: Sequence[TransportOrder]) -> None:
        """Assign to each free vehicle the order that suits it best."""
        free = [each for each in self._vehicles.values() if not each.obstacle]
        keys = self._settings.order_candidates
        rank = rank_candidates(keys, self._now)
        for vehicle in sorted(free, key=rank_vehicles(self._settings.vehicles)):
            fitting = (each for each in orders if each.number not in self._assigned)
            pairs = [*self._possible((each, vehicle) for each in fitting if not self._why_not(each, vehicle))]
            if pairs:
                why = Reason(R.ASSIGNED_FIRST_ORDER, key=keys[0], count=len(pairs))
                self._assign(min(pairs, key=rank), why)

    def assign_together(self, orders: Sequence[TransportOrder]) -> None:
        """Assign orders of the same rank so that they cost least together, those of the first rank first.

        Where all orders are of one rank and level, vehicles that are about to be free count too: an order
        that suits one of them better is left to it, unless a free vehicle would have no order then.
        """
        keys = self._settings.orders
        ranked = [*takewhile(lambda key: key not in SINGLE_OUT, keys)]
        ordered = [*takewhile(lambda key: key is not OrderKey.BY_AGE, keys)]

        def rank(order: TransportOrder) -> Rank:
            return order.number not in self._kept, *(ORDER_VALUES[key](order, self._now) for key in ranked)

        def level(order: TransportOrder) -> Rank:
            return tuple(ORDER_VALUES[key](order, self._now) for key in ordered)

        groups = [[*group] for _, group in groupby(orders, rank)]
        for alike in groups:
            if not self.free:
                return
            parts = [part for _, same in groupby(alike, level) for part in self._by_age_window([*same])]
            only_one = len(groups) == len(parts) == 1
            pairs = self._cheapest_pairs(alike, self.soon if only_one else {})
            levels = [
                {each.number: pairs[each.number].costs for each in part if each.number in pairs}
                for part in parts
            ]
            for number, vehicle in assign(levels).items():
                if vehicle in self.soon:
                    continue
                choices = pairs[number]
                best = choices.pairs[vehicle]
                nearest = best is choices.nearest
                self._assign(best, self._why(best, choices.free) if nearest else choices.why(best))

    def _by_age_window(self, orders: Sequence[TransportOrder]) -> Iterator[list[TransportOrder]]:
        """Split orders, oldest first, into windows of age: none overtakes an order of an earlier window."""
        window, part = timedelta(seconds=self._settings.age_window), list[TransportOrder]()
        for order in orders:
            if part and order.status.created > part[0].status.created + window:
                yield part
                part = []
            part.append(order)
        if part:
            yield part

    def _cheapest_pairs(
        self, orders: Sequence[TransportOrder], soon: Mapping[str, DispatchedVehicle]
    ) -> dict[int, _Choices]:
        """Return the vehicles that orders could have, for each as many as there are orders: enough.

        ``soon`` are vehicles that could have them soon.
        """
        rank = rank_candidates(self._settings.vehicle_candidates, self._now)
        known: dict[OrderKind, dict[str, str]] = {}
        found = {}
        for order in orders:
            kind, is_kept = self._kind(order), order.number in self._kept
            wait_reasons = None if is_kept else known.get(kind)
            if wait_reasons is None:
                wait_reasons = {each.name: self._why_not(order, each) for each in self._meant(order)}
            if not is_kept:
                known[kind] = wait_reasons
            free = [name for name, wait_reason in wait_reasons.items() if not wait_reason]
            pairs = [*self._possible((order, self._vehicles[name]) for name in free)]
            if pairs and not is_kept:
                later = (each for each in soon.values() if not self._why_not(order, each))
                pairs += self._possible((order, each) for each in later)
            if nearest := pairs if len(pairs) <= 1 else nsmallest(len(orders), pairs, key=rank):
                crowding = self._settings.crowding if len(orders) > 1 else 0.0
                dearer = crowding and crowding * self._knowledge.crowd(order)
                found[order.number] = _Choices(
                    nearest, self._count(order, free), self._settings.vehicle_candidates[0], dearer
                )
            else:
                self.decisions.reasons[order.name] = self._why_waiting(order, wait_reasons, free)
        return found

    def let_orders_choose(self, orders: Sequence[TransportOrder]) -> None:
        """Assign to each remaining order the vehicle that suits it best, or note why it waits."""
        rank = rank_candidates(self._settings.vehicle_candidates, self._now)
        unassignable: dict[OrderKind, str] = {}
        for order in orders:
            if order.number in self._assigned or order.name in self.decisions.reasons:
                continue
            if unassignable and order.number not in self._kept:
                known = unassignable.get(self._kind(order))
                if known is not None:
                    self.decisions.reasons[order.name] = known
                    continue
            wait_reasons = {each.name: self._why_not(order, each) for each in self._meant(order)}
            free = [name for name, wait_reason in wait_reasons.items() if not wait_reason]
            if free:
                self._choose(order, free, rank)
                continue
            reason = self.decisions.reasons[order.name] = self._why_waiting(order, wait_reasons, free)
            if order.number not in self._kept:
                unassignable[self._kind(order)] = reason

    def _choose(self, order: TransportOrder, free: Sequence[str], rank: Callable[[Candidate], Rank]) -> None:
        pairs = [*self._possible((order, self._vehicles[name]) for name in free)]
        if pairs:
            best = min(pairs, key=rank)
            self._assign(best, self._why(best, self._count(order, free)))
        else:
            self.decisions.reasons[order.name] = self._why_waiting(order, {}, free)

    def _count(self, order: TransportOrder, free: Sequence[str]) -> int:
        """Return the number of free vehicles that could execute an order."""
        return len(free) + self.left_out.get(order.number, 0)

    def _why_waiting(
        self, order: TransportOrder, wait_reasons: Mapping[str, str], free: Sequence[str]
    ) -> str:
        """Return why no vehicle takes an order: none is ``free`` for it, or the free ones have no route."""
        if not free:
            return why_no_vehicle(self._intended(order), wait_reasons)
        why = self._knowledge.why_no_route(order, free[-1])
        return Reason(R.VEHICLE_HAS_NO_ROUTE, why, vehicle=free[-1])

    def _possible(self, pairs: Iterable[tuple[TransportOrder, DispatchedVehicle]]) -> Iterator[Candidate]:
        for order, vehicle in pairs:
            cost = self._knowledge.cost(order, vehicle.name)
            if cost.complete < inf:
                yield Candidate(order, vehicle, cost)

    def _assign(self, pair: Candidate, why: str) -> None:
        order, vehicle = pair.order, pair.vehicle
        self._assigned.add(order.number)
        self._vehicles[vehicle.name] = DispatchedVehicle(vehicle.name, BUSY)
        self.decisions.assignments.append(Assignment(order, vehicle.name, why, vehicle.gives_up))

    def _kind(self, order: TransportOrder) -> OrderKind:
        kind = self._kinds.get(order.number)
        if kind is None:
            kind = self._kinds[order.number] = kind_of(order)
        return kind

    def _intended(self, order: TransportOrder) -> str | None:
        return self._kept.get(order.number, order.status.intended_vehicle)

    def _meant(self, order: TransportOrder) -> Iterable[DispatchedVehicle]:
        intended = self._intended(order)
        if intended is None:
            return self._vehicles.values()
        return (self._vehicles[intended],) if intended in self._vehicles else ()

    def _why_not(self, order: TransportOrder, vehicle: DispatchedVehicle) -> str:
        intended = self._intended(order)
        if intended not in (None, vehicle.name):
            return NOT_INTENDED
        why_unsuitable = self._knowledge.why_unsuitable(order, vehicle.name)
        if why_unsuitable:
            return why_unsuitable
        recharges = self._restricted and self._knowledge.recharges(order)
        pick = self._knowledge.pick(order) if self._loaded else None
        return vehicle.why_not(order, recharges=recharges, pick=pick)

    def _why(self, best: Candidate, choices: int) -> str:
        if self._intended(best.order) is not None:
            return Reason(R.ASSIGNED_INTENDED)
        if choices == 1:
            return Reason(R.ASSIGNED_ONLY_FREE)
        key = self._settings.vehicle_candidates[0]
        if key is CandidateKey.BY_COMPLETE_ROUTING_COSTS:
            return Reason(R.ASSIGNED_CHEAPEST, cost=best.cost.complete, count=choices)
        return Reason(R.ASSIGNED_FIRST, key=key, count=choices)


def why_no_vehicle(intended: str | None, wait_reasons: Mapping[str, str]) -> str:
    """Return why an order waits, from the reasons of all vehicles."""
    if intended is not None:
        why = wait_reasons.get(intended) or Reason(R.TAKES_NO_ORDERS)
        return Reason(R.WAITS_FOR_VEHICLE, why, vehicle=intended)
    if not wait_reasons:
        return Reason(R.NO_VEHICLES)
    kinds = sorted(set(wait_reasons.values()))
    more = [Reason(R.SOMETHING_ELSE)] if len(kinds) > KINDS_NAMED else []
    return Reason(R.WAITS_FOR_ANY_VEHICLE, *kinds[:KINDS_NAMED], *more)


COULD = Reason(R.FITS)


@dataclass(frozen=True, slots=True)
class VehicleFit:
    """The feasibility of one order for one vehicle."""

    vehicle: str
    fits: bool
    """Whether the vehicle could do it now."""
    reason: str
    """Why not, as a predicate; or that it could execute the order."""
    cost: float | None = None
    """Cost of its route, in the router's unit, if feasible."""


def explain(
    order: TransportOrder,
    vehicles: Iterable[DispatchedVehicle],
    knowledge: Knowledge,
    *,
    kept: Mapping[int, str] = NOTHING_KEPT,
) -> list[VehicleFit]:
    """Return for each vehicle why it does not get this order, or that it could; best vehicles first."""
    return best_first(_fit(order, each, knowledge, kept.get(order.number)) for each in vehicles)


def best_first(fits: Iterable[VehicleFit]) -> list[VehicleFit]:
    """Sort with feasible vehicles first, by their cost."""
    return sorted(fits, key=lambda each: (not each.fits, each.cost or 0.0, each.vehicle))


def _fit(
    order: TransportOrder, vehicle: DispatchedVehicle, knowledge: Knowledge, kept: str | None
) -> VehicleFit:
    if order.vehicle == vehicle.name and not order.state.final:
        return VehicleFit(vehicle.name, fits=True, reason=Reason(R.DOES_IT))
    intended = order.status.intended_vehicle
    for wanted, why in (
        (kept, Reason(R.RESERVED_IS, vehicle=kept or "")),
        (intended, Reason(R.INTENDED_IS, vehicle=intended or "")),
    ):
        if wanted not in (None, vehicle.name):
            return VehicleFit(vehicle.name, fits=False, reason=why)
    recharges, pick = knowledge.recharges(order), knowledge.pick(order)
    reason = knowledge.why_unsuitable(order, vehicle.name) or vehicle.why_not(
        order, recharges=recharges, pick=pick
    )
    if reason:
        return VehicleFit(vehicle.name, fits=False, reason=reason)
    cost = knowledge.cost(order, vehicle.name).complete
    if cost == inf:
        why = Reason(R.HAS_NO_ROUTE, knowledge.why_no_route(order, vehicle.name))
        return VehicleFit(vehicle.name, fits=False, reason=why)
    return VehicleFit(vehicle.name, fits=True, reason=COULD, cost=cost)
