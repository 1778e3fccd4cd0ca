"""Choose vehicles for orders: the rules of the settings, the cheapest assignment, and why orders wait."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import cached_property
from heapq import heappop, heappush
from itertools import groupby, takewhile
from math import inf
from types import MappingProxyType
from typing import Final, Protocol

from nena_order_service.dispatching.candidates import DispatchedVehicle, OrderKind, stops_of
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

    def is_at_risk(self, order: TransportOrder) -> bool:
        """Whether an order's deadline is at risk."""
        deadline = order.status.deadline
        return deadline is not None and deadline <= self.time + self.at_risk


def _deadline_of(order: TransportOrder) -> float:
    deadline = order.status.deadline
    return deadline.timestamp() if deadline else inf


ORDER_VALUES: Final[Mapping[OrderKey, Callable[[TransportOrder, Now], float | str]]] = MappingProxyType(
    {
        OrderKey.BY_PRIORITY: lambda order, _: -order.status.priority,
        OrderKey.BY_DEADLINE: lambda order, _: _deadline_of(order),
        OrderKey.DEADLINE_AT_RISK_FIRST: lambda order, now: not now.is_at_risk(order),
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
        CandidateKey.BY_DEADLINE: lambda pair, _: _deadline_of(pair.order),
        CandidateKey.DEADLINE_AT_RISK_FIRST: lambda pair, now: not now.is_at_risk(pair.order),
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


def assign_vehicles(levels: Sequence[Mapping[int, Costs]]) -> dict[int, str]:
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
        return _nearest_order(levels, vehicles.pop())
    search = _Search(levels)
    for level in levels:
        search.add_level(level)
    return search.vehicle_of_order


def _nearest_order(levels: Sequence[Mapping[int, Costs]], vehicle: str) -> dict[int, str]:
    """Return the order of the first level that the only vehicle can execute at the lowest cost."""
    for level in levels:
        if offers := {order: costs[vehicle] for order, costs in level.items() if costs}:
            return {min(offers, key=offers.__getitem__): vehicle}
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
    def vehicle_of_order(self) -> dict[int, str]:
        """The vehicles by the orders assigned to them."""
        return {order: place for order, place in self._place_of.items() if isinstance(place, str)}

    def add_level(self, level: Mapping[int, Costs]) -> None:
        """Add the orders of a level; orders left out stay left out, the others stay assigned."""
        for order, costs in level.items():
            self._costs[order] = dict[Place, int](costs.items()) | {order: self._left_out}
            self._of_orders[order] = 0
            self._augment_matching(order)
        # A later level must not overtake: an order that has a vehicle keeps it.
        for order in level:
            if order in self._order_of:
                del self._order_of[order], self._place_of[order], self._costs[order]
            else:
                del self._costs[order][order]

    def _augment_matching(self, new: int) -> None:
        """Assign the cheapest vehicle to an order; other orders change theirs if that costs less."""
        reached: dict[Place, int] = {}
        by: dict[Place, int] = {}
        heap: list[tuple[int, int, Place]] = []
        settled: dict[Place, None] = {}
        order: int | None = new
        distance = pushed = 0
        while order is not None:
            base = distance - self._of_orders[order]
            for place, cost in self._costs[order].items():
                length = base + cost - self._of_places.get(place, 0)
                if place not in settled and (place not in reached or length < reached[place]):
                    reached[place], by[place] = length, order
                    heappush(heap, (length, pushed, place))
                    pushed += 1
            distance, _, end = heappop(heap)  # there is one: an order that is new can be left out
            while end in settled:
                distance, _, end = heappop(heap)
            settled[end] = None
            order = self._order_of.get(end)
        # Raise the potentials of all that was reached on the way, so that no pair costs less than nothing.
        self._of_orders[new] += distance
        for place in settled:
            change = distance - reached[place]
            self._of_places[place] = self._of_places.get(place, 0) - change
            if (taken_by := self._order_of.get(place)) is not None:
                self._of_orders[taken_by] += change
        # Walk the path back: each order on it hands its vehicle to the one that reached it.
        while True:
            order = by[end]
            previous = self._place_of.get(order)
            self._order_of[end], self._place_of[order] = order, end
            if previous is None:
                return
            end = previous


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

PAIRS_AT_ONCE: Final = 2_000
MOST_AT_ONCE: Final = 64
FEWEST_AT_ONCE: Final = 16
"""How many orders are assigned together: as many as make this number of pairs with the free vehicles, within
these limits. The work of :func:`assign` grows faster than the number of orders: 64 of them with 64 vehicles
take some 15 ms, and 16 with 300 vehicles 1 ms. The less urgent orders follow in the next batch."""

KINDS_NAMED: Final = 5
"""Maximum number of kinds of obstacles named in a reason."""

NOTHING_KEPT: Final[Mapping[int, str]] = MappingProxyType({})


class Knowledge(Protocol):
    """Queries of the dispatcher about orders and vehicles."""

    def kind_of(self, order: TransportOrder) -> OrderKind:
        """Return the kind of an order."""
        ...

    def vehicles_named_by(self, order: TransportOrder) -> Collection[str]:
        """Return the vehicles that an order or its sequence names: for others, only their group counts."""
        ...

    def why_unsuitable(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason | None:
        """Return why a vehicle must not execute an order, regardless of its current work; None if it may.

        The answer is the same for all orders of one :class:`OrderKind`.
        """
        ...

    def recharges_next(self, order: TransportOrder) -> bool:
        """Return whether the next operation of an order is to recharge."""
        ...

    def first_pick(self, order: TransportOrder) -> Pick | None:
        """Return what an order picks up first; None: nothing, or it drops something before."""
        ...

    def route_costs(
        self, order: TransportOrder, vehicles: Sequence[DispatchedVehicle]
    ) -> Sequence[tuple[float, float]]:
        """Return the costs of each vehicle's route, complete and to the first destination; infinity: none."""
        ...

    def outstanding_visits(self) -> Mapping[str | None, int]:
        """Return how often vehicles will still visit each location or point for their orders."""
        ...

    def why_no_route(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason:
        """Return why there is no route."""
        ...


@dataclass(frozen=True, slots=True)
class Assignment:
    """One order for one vehicle."""

    order: TransportOrder
    vehicle: str
    why: Reason
    """Why this vehicle was chosen."""
    gives_up: str = ""
    """Name of the dispensable order that the vehicle must give up first; empty if none."""


@dataclass(slots=True)
class Decisions:
    """Assignments to make now, and the reasons why other orders wait."""

    assignments: list[Assignment] = field(default_factory=list)
    reasons: dict[str, Reason] = field(default_factory=dict)
    """Wait reason of each unassigned order by name; it stays the same while it holds."""


@dataclass(frozen=True, slots=True)
class Dispatcher:
    """Decides by the rules of its settings."""

    settings: DispatchSettings

    def decide(
        self,
        orders: Iterable[TransportOrder],
        vehicles: Iterable[DispatchedVehicle],
        knowledge: Knowledge,
        *,
        now: datetime,
        kept: Mapping[int, str] = NOTHING_KEPT,
    ) -> Decisions:
        """Assign as many of the dispatchable ``orders``, sorted by urgency, as possible.

        ``kept`` maps order numbers to vehicles that give up dispensable orders for them; only these vehicles
        get these orders. An order is never assigned to two vehicles, nor two orders to one vehicle.
        """
        settings = self.settings
        moment = Now(now, timedelta(seconds=settings.deadline_at_risk))
        waiting = [*orders]
        # They come sorted by URGENCY, which is the default: sorting hundreds again in each decision costs.
        if tuple(settings.orders) != URGENCY:
            waiting.sort(key=rank_orders(settings.orders, moment))
        if kept:  # the vehicles are about to be free for these orders
            waiting.sort(key=lambda order: order.number not in kept)
        decision = _Decision(settings, _Fleet(vehicles, knowledge, kept), knowledge, moment, kept)
        if settings.choosers is Chooser.SCARCER and len(decision.fleet.free) < len(waiting):
            decision.let_vehicles_choose(waiting)
        if settings.choosers is Chooser.TOGETHER and settings.vehicle_candidates[0] in ROUTING_COSTS:
            decision.assign_together(waiting)
        else:
            decision.let_orders_choose(waiting)
        decision.explain_waiting(waiting)
        return decision.decisions


class _Fleet:
    """The vehicles of a decision, and which of them take an order.

    Vehicles of a group differ only in name, position and energy, so one of them answers for all: orders in
    sequences are each of their own kind, and would otherwise be compared with the whole fleet.
    """

    def __init__(
        self, vehicles: Iterable[DispatchedVehicle], knowledge: Knowledge, kept: Mapping[int, str]
    ) -> None:
        self.free: dict[str, DispatchedVehicle] = {}
        """Vehicles that take orders, and have not got one yet."""
        self.soon: dict[str, DispatchedVehicle] = {}
        """Vehicles that will soon be free, in the state that they will have then."""
        self._knowledge = knowledge
        self._kept = kept
        self._vehicles: dict[str, DispatchedVehicle] = {}
        self._groups: dict[tuple[object, ...], dict[str, DispatchedVehicle]] = {}
        self._takers: dict[OrderKind, list[dict[str, DispatchedVehicle]]] = {}
        """The groups of vehicles that take the orders of a kind, apart from those that the order names."""
        for vehicle in vehicles:
            self._add_vehicle(vehicle)
            if not vehicle.obstacle:
                self.free[vehicle.name] = vehicle
            elif vehicle.soon:
                self.soon[vehicle.name] = vehicle._replace(obstacle=None)

    def _add_vehicle(self, vehicle: DispatchedVehicle) -> None:
        self._vehicles[vehicle.name] = vehicle
        self._groups.setdefault(vehicle.group, {})[vehicle.name] = vehicle

    def make_busy(self, vehicle: DispatchedVehicle) -> None:
        """Make a free vehicle busy."""
        del self.free[vehicle.name], self._groups[vehicle.group][vehicle.name]
        self._add_vehicle(vehicle._replace(obstacle=BUSY))

    def intended_vehicle(self, order: TransportOrder) -> str | None:
        """Return the only vehicle that may get an order; None: any."""
        return self._kept.get(order.number, order.status.intended_vehicle)

    def has_busy_vehicle(self, order: TransportOrder) -> bool:
        """Return whether an order is for one vehicle, which is not free."""
        intended = self.intended_vehicle(order)
        return intended is not None and intended not in self.free

    def why_not(self, order: TransportOrder, vehicle: DispatchedVehicle) -> Reason | None:
        """Return why a vehicle does not take an order; None if it does."""
        if self.intended_vehicle(order) not in (None, vehicle.name):
            return NOT_INTENDED
        knowledge = self._knowledge
        # While most vehicles are busy, what an order recharges or picks up matters to none of them.
        if why := knowledge.why_unsuitable(order, vehicle) or vehicle.obstacle:
            return why
        return vehicle.why_not(
            order, recharges=knowledge.recharges_next(order), pick=knowledge.first_pick(order)
        )

    def find_takers(self, order: TransportOrder) -> list[DispatchedVehicle]:
        """Return the free vehicles that take an order."""
        intended = self.intended_vehicle(order)
        if intended is not None:
            vehicle = self.free.get(intended)
            return [vehicle] if vehicle and not self.why_not(order, vehicle) else []
        named = self._knowledge.vehicles_named_by(order)
        kind = self._knowledge.kind_of(order)
        groups = self._takers.get(kind)
        if groups is None:
            groups = self._takers[kind] = [
                group
                for group, example in self._group_examples(named)
                if not example.obstacle and not self.why_not(order, example)
            ]
        vehicles = [vehicle for group in groups for vehicle in group.values()]
        if named:
            vehicles = [vehicle for vehicle in vehicles if vehicle.name not in named]
            free = (self.free[name] for name in named if name in self.free)
            vehicles += [vehicle for vehicle in free if not self.why_not(order, vehicle)]
        return vehicles

    def why_waiting(self, order: TransportOrder) -> Reason:
        """Return why no vehicle takes an order; call it only if none does."""
        intended = self.intended_vehicle(order)
        if intended is not None:
            vehicle = self._vehicles.get(intended)
            return why_no_vehicle(intended, [self.why_not(order, vehicle)] if vehicle else [])
        named = self._knowledge.vehicles_named_by(order)
        vehicles = [example for _, example in self._group_examples(named)]
        vehicles += [self._vehicles[name] for name in named if name in self._vehicles]
        return why_no_vehicle(None, [self.why_not(order, vehicle) for vehicle in vehicles])

    def _group_examples(
        self, named: Collection[str]
    ) -> Iterator[tuple[dict[str, DispatchedVehicle], DispatchedVehicle]]:
        """Yield each group with one of its vehicles that is not ``named``."""
        for group in self._groups.values():
            vehicle = next((group[name] for name in group if name not in named), None)
            if vehicle:
                yield group, vehicle


class _Choices:
    """The vehicles that could execute one order."""

    def __init__(self, pairs: Sequence[Candidate], free: int, key: CandidateKey, dearer: float) -> None:
        """Store pairs, the best first, and the share by which others at its destinations make it ``dearer``.

        The pairs may contain only the nearest of the ``free`` vehicles.
        """
        self.pairs = {pair.vehicle.name: pair for pair in pairs}
        self.nearest, self.free = pairs[0], free
        complete = key is CandidateKey.BY_COMPLETE_ROUTING_COSTS
        own = min(pair.cost.complete - pair.cost.initial for pair in pairs) if complete else 0.0
        values = (pair.cost.complete if complete else pair.cost.initial for pair in pairs)
        self.costs = {
            pair.vehicle.name: round((value - own + dearer * pair.cost.complete) * COST_STEPS) * RANKS
            + min(place, RANKS - 1)
            for place, (pair, value) in enumerate(zip(pairs, values, strict=True))
        }
        """Each vehicle's cost beyond the order's own route, which is the same for all."""


@dataclass(frozen=True, slots=True)
class _Offer:
    """An order, the pairs with the nearest free vehicles that have a route for it, and how many take it."""

    order: TransportOrder
    pairs: Sequence[Candidate]
    takers: int


class _Decision:
    """A decision in progress."""

    def __init__(
        self,
        settings: DispatchSettings,
        fleet: _Fleet,
        knowledge: Knowledge,
        now: Now,
        kept: Mapping[int, str],
    ) -> None:
        self.decisions = Decisions()
        self.fleet = fleet
        self._settings = settings
        self._knowledge = knowledge
        self._now = now
        self._kept = kept
        self._key = settings.vehicle_candidates[0]
        self._rank = rank_candidates(settings.vehicle_candidates, now)
        self._assigned: set[int] = set()
        self._reasons: dict[int | OrderKind, Reason] = {}
        """Why no vehicle takes the orders of a kind, or one with a reserved vehicle."""

    @cached_property
    def _visits(self) -> Mapping[str | None, int]:
        # Counted at most once for a decision, and only where stations can be crowded.
        return self._knowledge.outstanding_visits()

    def let_vehicles_choose(self, orders: Sequence[TransportOrder]) -> None:
        """Assign to each free vehicle the order that suits it best."""
        keys = self._settings.order_candidates
        rank = rank_candidates(keys, self._now)
        for vehicle in sorted(self.fleet.free.values(), key=rank_vehicles(self._settings.vehicles)):
            left = (order for order in orders if order.number not in self._assigned)
            suitable = (order for order in left if not self.fleet.why_not(order, vehicle))
            pairs = [pair for order in suitable for pair in self._best_pairs(order, [vehicle], 1)]
            if pairs:
                why = Reason(R.ASSIGNED_FIRST_ORDER, key=keys[0], count=len(pairs))
                self._assign_pair(min(pairs, key=rank), why)

    def let_orders_choose(self, orders: Iterable[TransportOrder]) -> None:
        """Assign to each order in turn the vehicle that suits it best."""
        for order in orders:
            if not self.fleet.free:
                return
            # `explain_waiting` says once, at the end, what an order for a busy vehicle waits for.
            if order.number in self._assigned or self.fleet.has_busy_vehicle(order):
                continue
            if offer := self._find_offer(order, 1):
                best = offer.pairs[0]
                self._assign_pair(best, self._why_best(best, offer.takers))

    def assign_together(self, orders: Iterable[TransportOrder]) -> None:
        """Assign orders of the same rank so that they cost least together, those of the first rank first.

        They are assigned in batches, the most urgent ones first. A batch has whole levels until it has an
        order for each free vehicle, or a part of a level that is large.
        """
        ranked = [*takewhile(lambda key: key not in SINGLE_OUT, self._settings.orders)]

        def rank(order: TransportOrder) -> Rank:
            return order.number not in self._kept, *(ORDER_VALUES[key](order, self._now) for key in ranked)

        for _, group in groupby(orders, rank):
            batch: list[list[_Offer]] = []
            for level in self._split_into_levels(group):
                batch.append([])
                for order in level:
                    if self.fleet.has_busy_vehicle(order):
                        continue
                    # The work of an assignment grows faster than its orders; see PAIRS_AT_ONCE.
                    if sum(map(len, batch)) == self._batch_limit():
                        self._assign_batch(batch)
                        batch = [[]]
                    if not self.fleet.free:
                        return
                    if offer := self._find_offer(order, self._batch_limit()):
                        batch[-1].append(offer)
                if sum(map(len, batch)) >= len(self.fleet.free):
                    self._assign_batch(batch)
                    batch = []
            self._assign_batch(batch)

    def _batch_limit(self) -> int:
        free = max(1, len(self.fleet.free))
        return max(FEWEST_AT_ONCE, min(MOST_AT_ONCE, PAIRS_AT_ONCE // free))

    def _split_into_levels(self, orders: Iterable[TransportOrder]) -> Iterator[Iterable[TransportOrder]]:
        """Split orders of one rank into levels, none of which overtakes an earlier one.

        The orders of a level have the same deadline and were created within the age window. Strictly by age,
        a vehicle would drive to a distant order past a near one; without windows, remote stations would
        starve.
        """
        keys = [*takewhile(lambda key: key is not OrderKey.BY_AGE, self._settings.orders)]
        window = timedelta(seconds=self._settings.age_window)
        first: tuple[Rank, datetime] | None = None

        def level(order: TransportOrder) -> tuple[Rank, datetime]:
            """Return the rank of the level, and when its first order was created."""
            nonlocal first
            values, created = tuple(ORDER_VALUES[key](order, self._now) for key in keys), order.status.created
            if first is None or values != first[0] or created > first[1] + window:
                first = values, created
            return first

        return (members for _, members in groupby(orders, level))

    def _find_offer(self, order: TransportOrder, at_most: int) -> _Offer | None:
        """Return what the free vehicles offer an order; without an offer, note why it waits."""
        takers = self.fleet.find_takers(order)
        if takers and (pairs := self._best_pairs(order, takers, at_most)):
            return _Offer(order, pairs, len(takers))
        self._note_reason(order)
        return None

    def _best_pairs(
        self, order: TransportOrder, vehicles: Sequence[DispatchedVehicle], at_most: int
    ) -> list[Candidate]:
        """Return the pairs of an order with vehicles that have a route for it, the best ones first."""
        costs = self._knowledge.route_costs(order, vehicles)
        limit = inf
        if self._key is CandidateKey.BY_COMPLETE_ROUTING_COSTS and len(vehicles) > at_most:
            # Further keys decide only between equal costs.
            limit = sorted([complete for complete, _ in costs])[at_most - 1]
        pairs = [
            Candidate(order, vehicle, RouteCost(*cost))
            for vehicle, cost in zip(vehicles, costs, strict=True)
            if cost[0] <= limit and cost[0] < inf
        ]
        return sorted(pairs, key=self._rank)[:at_most]

    def _assign_batch(self, batch: Sequence[Sequence[_Offer]]) -> None:
        """Assign orders to free vehicles at the least total cost.

        If all are of one level, vehicles that are about to be free count too: an order that suits one of
        them better is left to it, unless a free vehicle would have no order then.
        """
        levels = [level for level in batch if level]
        size = sum(map(len, levels))
        soon = self.fleet.soon if len(levels) == 1 else {}
        choices = {
            offer.order.number: self._combine_choices(offer, soon.values(), size)
            for level in levels
            for offer in level
        }
        left_to_soon = []
        costs = [
            {offer.order.number: choices[offer.order.number].costs for offer in level} for level in levels
        ]
        for number, name in assign_vehicles(costs).items():
            best, free = choices[number].pairs[name], choices[number].free
            if name in soon:
                left_to_soon.append(best.order)
            else:
                least = Reason(R.ASSIGNED_LEAST_DRIVING, cost=best.cost.complete, count=free)
                nearest = best is choices[number].nearest
                self._assign_pair(best, self._why_best(best, free) if nearest else least)
        self.let_orders_choose(left_to_soon)

    def _combine_choices(self, offer: _Offer, soon: Collection[DispatchedVehicle], size: int) -> _Choices:
        """Return the best vehicles for an order, as many as the batch has orders: enough."""
        order, pairs = offer.order, offer.pairs
        if soon and order.number not in self._kept:
            later = [vehicle for vehicle in soon if not self.fleet.why_not(order, vehicle)]
            pairs = sorted([*pairs, *self._best_pairs(order, later, size)], key=self._rank)
        # Queues before stations on aisles block everyone else (decision 0038). One order alone is not spread.
        crowding = self._settings.crowding if size > 1 else 0.0
        visits = sum(self._visits.get(stop.location_name, 0) for stop in stops_of(order)) if crowding else 0
        return _Choices(pairs[:size], offer.takers, self._key, crowding * visits)

    def _assign_pair(self, pair: Candidate, why: Reason) -> None:
        order, vehicle = pair.order, pair.vehicle
        self._assigned.add(order.number)
        self.fleet.make_busy(vehicle)
        self.decisions.assignments.append(Assignment(order, vehicle.name, why, vehicle.gives_up))

    def _why_best(self, best: Candidate, choices: int) -> Reason:
        """Return why an order gets the vehicle that suits it best of several choices."""
        if self.fleet.intended_vehicle(best.order) is not None:
            return Reason(R.ASSIGNED_INTENDED)
        if choices == 1:
            return Reason(R.ASSIGNED_ONLY_FREE)
        if self._key is CandidateKey.BY_COMPLETE_ROUTING_COSTS:
            return Reason(R.ASSIGNED_CHEAPEST, cost=best.cost.complete, count=choices)
        return Reason(R.ASSIGNED_FIRST, key=self._key, count=choices)

    def explain_waiting(self, orders: Iterable[TransportOrder]) -> None:
        """Note why the orders that have not had their turn wait."""
        self._reasons.clear()  # the vehicles that have got orders are busy
        for order in orders:
            if order.number not in self._assigned and order.name not in self.decisions.reasons:
                self._note_reason(order)

    def _note_reason(self, order: TransportOrder) -> None:
        """Note why an order waits: no vehicle takes it, or those that do have no route."""
        # Orders of a kind share their reason: with hundreds waiting, working it out for each is too slow.
        key: int | OrderKind = order.number
        if order.number not in self._kept:
            key = self._knowledge.kind_of(order)
        why = self._reasons.get(key)
        if why is None and self.fleet.free and (takers := self.fleet.find_takers(order)):
            vehicle = max(takers, key=lambda taker: taker.name)
            no_route = self._knowledge.why_no_route(order, vehicle)
            why = Reason(R.VEHICLE_HAS_NO_ROUTE, no_route, vehicle=vehicle.name)
        elif why is None:
            why = self._reasons[key] = self.fleet.why_waiting(order)
        self.decisions.reasons[order.name] = why


def why_no_vehicle(intended: str | None, wait_reasons: Collection[Reason | None]) -> Reason:
    """Return why an order waits, from the reasons of all vehicles."""
    if intended is not None:
        why = next(filter(None, wait_reasons), Reason(R.TAKES_NO_ORDERS))
        return Reason(R.WAITS_FOR_VEHICLE, why, vehicle=intended)
    if not wait_reasons:
        return Reason(R.NO_VEHICLES)
    # Each reason once: a text that names every vehicle would grow with the fleet and change all the time.
    kinds = sorted({reason for reason in wait_reasons if reason}, key=str)
    more = [Reason(R.SOMETHING_ELSE)] if len(kinds) > KINDS_NAMED else []
    return Reason(R.WAITS_FOR_ANY_VEHICLE, *kinds[:KINDS_NAMED], *more)


COULD = Reason(R.FITS)


@dataclass(frozen=True, slots=True)
class VehicleFit:
    """The feasibility of one order for one vehicle."""

    vehicle: str
    fits: bool
    """Whether the vehicle could do it now."""
    reason: Reason
    """Why not, as a predicate; or that it could execute the order."""
    cost: float | None = None
    """Cost of its route, in the router's unit, if feasible."""


def explain_fits(
    order: TransportOrder,
    vehicles: Iterable[DispatchedVehicle],
    knowledge: Knowledge,
    *,
    kept: Mapping[int, str] = NOTHING_KEPT,
) -> list[VehicleFit]:
    """Return for each vehicle why it does not get this order, or that it could; cheapest vehicles first."""
    fits = (_explain_fit(order, vehicle, knowledge, kept.get(order.number)) for vehicle in vehicles)
    return sorted(fits, key=lambda fit: (not fit.fits, fit.cost or 0.0, fit.vehicle))


def _explain_fit(
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
    recharges, pick = knowledge.recharges_next(order), knowledge.first_pick(order)
    reason = knowledge.why_unsuitable(order, vehicle) or vehicle.why_not(
        order, recharges=recharges, pick=pick
    )
    if reason:
        return VehicleFit(vehicle.name, fits=False, reason=reason)
    ((cost, _),) = knowledge.route_costs(order, [vehicle])
    if cost == inf:
        why = Reason(R.HAS_NO_ROUTE, knowledge.why_no_route(order, vehicle))
        return VehicleFit(vehicle.name, fits=False, reason=why)
    return VehicleFit(vehicle.name, fits=True, reason=COULD, cost=cost)
