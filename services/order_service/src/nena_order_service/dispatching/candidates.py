"""The two sides of an assignment: orders that wait, and vehicles as the dispatcher sees them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush, heapreplace, merge
from itertools import islice
from math import inf
from typing import NamedTuple

from nena_order_service.fleet.position import Standing
from nena_order_service.fleet.robot import RobotView
from nena_order_service.orders.transport_order import TransportOrder, Urgency
from nena_order_service.orders.vda_orders import Pick
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.fleet_api.vehicle import ANY_ORDER_TYPE, ANY_TYPE, AcceptableOrderType
from nena_shared.plant.model import EnergyThresholds
from nena_shared.vda5050.action import LOAD_HANDLING_DEVICE
from nena_shared.vda5050.factsheet import Factsheet, LoadSpecification
from nena_shared.vda5050.state import State

R = ReasonCode


class OrderKind(NamedTuple):
    """Everything that decides which vehicles may get an order; equal for all orders of one kind."""

    intended_vehicle: str | None
    sequence: str | None
    excluded_vehicles: tuple[str, ...]
    type: str
    dispensable: bool
    automatic: bool
    demands: tuple[tuple[str, str, str], ...]
    """Operation, loadType and lhd of each remaining destination."""


def kind_of(order: TransportOrder) -> OrderKind:
    """Return the kind of an order; it stays the same while the order waits."""
    status = order.status
    return OrderKind(
        status.intended_vehicle,
        status.wrapping_sequence,
        tuple(status.excluded_vehicles),
        status.type,
        status.dispensable,
        status.automatic,
        tuple(
            (
                each.destination.operation,
                next((given.text for given in each.destination.properties if given.key == "loadType"), ""),
                next(
                    (
                        given.text
                        for given in each.destination.properties
                        if given.key in LOAD_HANDLING_DEVICE
                    ),
                    "",
                ),
            )
            for each in status.drive_orders[order.index :]
        ),
    )


KindHead = tuple[Urgency, OrderKind]
"""A kind of orders that wait, and its most urgent order."""


class WaitingOrders:
    """Finds the most urgent orders of some kinds without checking the others.

    A held order waits too, but has no kind: no vehicle gets it.
    """

    def __init__(self) -> None:
        self.fresh: dict[int, None] = {}
        """Numbers of orders that free vehicles may not have been compared with; emptied by the dispatcher."""
        self._queue: list[Urgency] = []
        """All waiting orders, most urgent first."""
        self._urgencies: dict[int, Urgency] = {}
        self._kinds: dict[OrderKind, list[Urgency]] = {}
        self._kind_of: dict[int, OrderKind] = {}
        """Kinds by order number, without held orders."""
        self._for_any: list[KindHead] = []
        """Kinds that name no vehicle, that of the most urgent order first."""
        self._for_one: dict[str, list[KindHead]] = {}
        """The same for kinds that name a vehicle, by vehicle name."""

    def __len__(self) -> int:
        """Return how many orders wait, held ones included."""
        return len(self._queue)

    def __iter__(self) -> Iterator[int]:
        """Yield the numbers of the orders that wait, most urgent first."""
        return (urgency[-1] for urgency in self._queue)

    @property
    def oldest(self) -> int | None:
        """Number of the order that was created first, whenever it was queued; None: the queue is empty."""
        return min(self._urgencies, default=None)

    def put(self, order: TransportOrder) -> None:
        """Keep an order exactly while it is dispatchable; meanwhile only its intended vehicle may change."""
        number, waits = order.number, order.state is TransportOrderState.DISPATCHABLE
        if waits and number not in self._urgencies:
            self._urgencies[number] = order.urgency
            insort(self._queue, order.urgency)
        if waits and not order.held:
            known_kind = self._kind_of.get(number)
            if known_kind is not None and known_kind.intended_vehicle != order.status.intended_vehicle:
                self._take_back(number, self._kind_of.pop(number))
                known_kind = None
            if known_kind is None:
                self._offer(number, kind_of(order))
        elif number in self._kind_of:
            self._take_back(number, self._kind_of.pop(number))
        if not waits and (known := self._urgencies.pop(number, None)):
            _remove(self._queue, known)

    def kind(self, number: int) -> OrderKind | None:
        """Return the kind of an order that waits; None for a held one."""
        return self._kind_of.get(number)

    def kinds(self, vehicles: Iterable[str]) -> Iterator[OrderKind]:
        """Yield the kinds of orders that wait for any vehicle or for one of these, most urgent first."""
        rows = (self._for_any, *(self._for_one.get(vehicle, ()) for vehicle in vehicles))
        return (kind for _, kind in merge(*filter(None, rows)))

    def naming(self, vehicle: str) -> Iterator[OrderKind]:
        """Yield the kinds of orders that wait for this vehicle only, most urgent first."""
        return (kind for _, kind in self._for_one.get(vehicle, ()))

    def example(self, kind: OrderKind) -> int:
        """Return the number of the most urgent order of a kind."""
        return self._kinds[kind][0][-1]

    def first(self, kinds: Iterable[OrderKind], limit: int, after: Urgency | None = None) -> list[int]:
        """Return the numbers of the most urgent orders of these kinds that come after ``after``.

        The kinds are sorted as by :meth:`kinds`. Without ``after``, no more of them are read than are needed.
        """
        rows = map(self._kinds.__getitem__, kinds)
        if after is None:
            return [urgency[-1] for urgency in islice(_merged(rows), limit)]
        starts = ((row, bisect_right(row, after)) for row in rows)
        parts = (row[start : start + limit] for row, start in starts)
        return [urgency[-1] for urgency in islice(merge(*parts), limit)]

    def part(self, start: int, limit: int) -> list[int]:
        """Return the numbers of ``limit`` orders from position ``start`` of the queue, held ones included."""
        return [urgency[-1] for urgency in self._queue[start : start + limit]]

    def _offer(self, number: int, kind: OrderKind) -> None:
        self._kind_of[number] = kind
        self.fresh[number] = None
        row, urgency = self._kinds.setdefault(kind, []), self._urgencies[number]
        before = row[0] if row else None
        insort(row, urgency)
        self._move(kind, before, row[0])

    def _take_back(self, number: int, kind: OrderKind) -> None:
        self.fresh.pop(number, None)
        row = self._kinds[kind]
        before = row[0]
        _remove(row, self._urgencies[number])
        self._move(kind, before, row[0] if row else None)
        if not row:
            del self._kinds[kind]

    def _move(self, kind: OrderKind, before: Urgency | None, now: Urgency | None) -> None:
        """Sort a kind by its most urgent order, which was or is None without orders."""
        if before == now:
            return
        vehicle = kind.intended_vehicle
        heads = self._for_any if vehicle is None else self._for_one.setdefault(vehicle, [])
        if before is not None:
            del heads[bisect_left(heads, before, key=_urgency_of)]
        if now is not None:
            insort(heads, (now, kind), key=_urgency_of)
        if not heads and vehicle is not None:
            del self._for_one[vehicle]


def _urgency_of(head: KindHead) -> Urgency:
    return head[0]


def _merged(rows: Iterable[Sequence[Urgency]]) -> Iterator[Urgency]:
    """Merge sorted rows that are sorted by their first items; read a row only when it is needed."""
    heap: list[tuple[Urgency, int, Sequence[Urgency]]] = []
    for row in rows:
        while heap and heap[0][0] < row[0]:
            yield _pop(heap)
        heappush(heap, (row[0], 0, row))
    while heap:
        yield _pop(heap)


def _pop(heap: list[tuple[Urgency, int, Sequence[Urgency]]]) -> Urgency:
    """Return the first item of all rows, and advance in its row."""
    urgency, place, row = heap[0]
    if place + 1 < len(row):
        heapreplace(heap, (row[place + 1], place + 1, row))
    else:
        heappop(heap)
    return urgency


def _remove(row: list[Urgency], urgency: Urgency) -> None:
    del row[bisect_left(row, urgency)]


@dataclass(frozen=True, slots=True)
class Energy:
    """How much energy a vehicle has in percent, and whether it is being charged."""

    level: float
    charging: bool
    thresholds: EnergyThresholds

    @property
    def critical(self) -> bool:
        """Whether it may only recharge."""
        return self.level <= self.thresholds.critical

    @property
    def degraded(self) -> bool:
        """Whether it should recharge when idle."""
        return self.level <= self.thresholds.good

    def recharged(self, *, fully: bool) -> bool:
        """Whether it has recharged enough to take an order, or ``fully``."""
        wanted = self.thresholds.fully_recharged if fully else self.thresholds.sufficiently_recharged
        return self.level >= wanted and not self.critical

    def restriction(self, *, fully: bool) -> str:
        """Return, as a predicate, why it only takes orders to recharge; empty if it takes any order.

        ``fully``: a charging vehicle continues until it is fully recharged, not just sufficiently. The text
        stays the same while the energy changes.
        """
        levels = self.thresholds
        if self.charging and not self.recharged(fully=fully):
            until = levels.fully_recharged if fully else max(levels.sufficiently_recharged, levels.critical)
            return Reason(R.RECHARGES, level=until)
        if self.critical:
            return Reason(R.MUST_RECHARGE, level=levels.critical)
        return ""


def acceptable(names: Iterable[str] | None) -> tuple[AcceptableOrderType, ...]:
    """Return types by name, in order of preference; None: any type is accepted."""
    if names is None:
        return ANY_ORDER_TYPE
    return tuple(AcceptableOrderType(name=name, priority=index) for index, name in enumerate(names))


def type_priority(accepted: Iterable[AcceptableOrderType], order_type: str) -> int | None:
    """Return the vehicle's priority for orders of this type, lower is preferred; None: type not accepted.

    The priority of the exact type overrides that of any type (``*``).
    """
    priorities = {each.name: each.priority for each in accepted}
    return priorities.get(order_type, priorities.get(ANY_TYPE))


def why_not_accepted(accepted: Sequence[AcceptableOrderType], order_type: str) -> str:
    """Return, as a predicate, why a vehicle takes no orders of this type; empty if it does."""
    if type_priority(accepted, order_type) is not None:
        return ""
    if not accepted:
        return Reason(R.ACCEPTS_NO_TYPE)
    names = ", ".join(repr(each.name) for each in sorted(accepted, key=lambda each: each.priority))
    return Reason(R.ACCEPTS_OTHER_TYPES, type=order_type, types=names)


@dataclass(frozen=True, slots=True)
class Carried:
    """The loads of a loaded vehicle."""

    loads: tuple[str, ...]
    """The load position of each; empty: not reported."""
    places: frozenset[str] = frozenset()
    """The vehicle's load positions; empty: not reported."""
    places_of: Mapping[str, frozenset[str]] = field(default_factory=dict, hash=False)
    """Load positions that only take loads of one type, by type."""

    def why_no_room(self, pick: Pick) -> str:
        """Return, as a predicate, why there is no room for a load; empty if there may be.

        A vehicle without known load positions has one; a load without a position may be on any of them.
        """
        if pick.place:
            wanted, elsewhere = frozenset({pick.place}), frozenset(self.loads) - {"", pick.place}
        else:
            wanted = self.places_of.get(pick.load_type, self.places)
            elsewhere = self.places - wanted
        if sum(load not in elsewhere for load in self.loads) < max(len(wanted), 1):
            return ""
        where = [Reason(R.AT_PLACE, place=pick.place)] if pick.place else []
        if len(self.loads) == 1:
            return Reason(R.LOADED, *where)
        return Reason(R.LOADED_SEVERAL, *where, count=len(self.loads))


def carried(state: State, factsheet: Factsheet | None) -> Carried | None:
    """Return the loads that a robot reports; None if it has none or cannot report them."""
    if not state.loads:
        return None
    loads = tuple(each.load_position or "" for each in state.loads)
    loading = factsheet.load_specification if factsheet else None
    if loading is None or not loading.load_positions:
        return Carried(loads)
    return Carried(loads, frozenset(loading.load_positions), _places_of(loading))


def _places_of(loading: LoadSpecification) -> dict[str, frozenset[str]]:
    """Return the load positions for each type; a load set that names none applies to all of them."""
    all_places, found = frozenset(loading.load_positions or ()), dict[str, frozenset[str]]()
    for each in loading.load_sets or ():
        places = all_places.intersection(each.load_positions or all_places)
        found[each.load_type] = found.get(each.load_type, frozenset()) | places
    return found


RESERVED = Reason(R.RESERVED)
DISPENSABLE = Reason(R.HAS_DISPENSABLE_ORDER)


@dataclass(frozen=True, slots=True)
class DispatchedVehicle:
    """Whether a vehicle takes orders now, and which; reasons are predicates such as "is offline"."""

    name: str
    obstacle: str = ""
    """Why it takes no order at all; empty if it may."""
    restriction: str = ""
    """Why it only takes orders to recharge; empty if it takes others too."""
    energy: float = 100.0
    """State of charge, percent."""
    idle: bool = True
    """Whether it neither charges nor has an order."""
    gives_up: str = ""
    """Name of the dispensable order that the vehicle would give up for another one; empty if none."""
    kept_for: int | None = None
    """Number of the order for which it gives up a dispensable one; it takes no other order."""
    order_types: tuple[AcceptableOrderType, ...] = ANY_ORDER_TYPE
    """The types of orders that it accepts."""
    carried: Carried | None = None
    """Its loads; None: none, or unknown."""
    soon: bool = False
    """Whether it will soon be free at its current position; until then, ``obstacle`` is set."""

    def type_priority(self, order: TransportOrder) -> float:
        """Return the priority of orders of this type, less is better; infinity: not accepted."""
        priority = type_priority(self.order_types, order.status.type)
        return inf if priority is None else priority

    def why_not(self, order: TransportOrder, *, recharges: bool, pick: Pick | None = None) -> str:
        """Return, as a predicate, why it does not take this order now; empty if it may.

        ``recharges``: the order's next operation is to recharge. ``pick``: the load that it is to pick up
        first; None: it drops something before, or picks up nothing.
        """
        if self.obstacle:
            return self.obstacle
        if self.kept_for is not None and self.kept_for != order.number:
            return RESERVED
        if self.restriction and not recharges:
            return self.restriction
        if self.gives_up and order.status.dispensable:
            return DISPENSABLE
        return self.carried.why_no_room(pick) if self.carried and pick else ""


EXAMPLES_AT_MOST = 50
"""Maximum vehicles checked for why none accepts an order; equal reasons count once."""


class FreeKind(NamedTuple):
    """Everything that decides which orders a free vehicle may get, apart from its name and position."""

    routing_kind: int
    sequence: str | None
    restriction: str
    order_types: tuple[AcceptableOrderType, ...]
    carried: Carried | None
    kept_for: int | None
    gives_up: bool


@dataclass(frozen=True, slots=True)
class LocatedCandidate:
    """A vehicle as the dispatcher sees it, and its position; None if unknown."""

    vehicle: FleetVehicle
    seen: DispatchedVehicle
    standing: Standing | None = None
    sequence: str | None = None
    """The order sequence to which it is bound."""
    order_types: tuple[AcceptableOrderType, ...] = ()
    view: RobotView | None = None
    """What was known of its robot; None: irrelevant."""
    routing_kind: int = 0
    """Number of its kind for the router: those of one kind have the same routes."""

    @property
    def significant_fields(self) -> tuple[object, ...]:
        """Return what is relevant for the assignment of orders; energy alone is not."""
        where = self.standing and self.standing.point
        return *self.reason_key, self.seen.restriction, self.seen.gives_up, self.seen.carried, where

    @property
    def free_kind(self) -> FreeKind:
        """Return what decides the orders that a free vehicle may get, unless they name or exclude it."""
        seen = self.seen
        return FreeKind(
            self.routing_kind,
            self.sequence,
            seen.restriction,
            seen.order_types,
            seen.carried,
            seen.kept_for,
            bool(seen.gives_up),
        )

    @property
    def reason_key(self) -> ReasonKey:
        """Return what decides a vehicle's reason towards orders that do not name or exclude it."""
        return self.seen.obstacle, self.order_types, self.sequence


ReasonKey = tuple[str, tuple[AcceptableOrderType, ...], str | None]


class Candidates:
    """Stores the last view of each vehicle: which are free, and what keeps the others."""

    def __init__(
        self, registry: VehicleRegistry, consider: Callable[[FleetVehicle], LocatedCandidate]
    ) -> None:
        self.free: dict[str, LocatedCandidate] = {}
        """Those that may get orders, by name."""
        self.alike: dict[FreeKind, dict[str, str]] = {}
        """The start points of those that may get orders, by kind and name."""
        self.soon: dict[str, None] = {}
        """Names of those that are about to be free."""
        self.fresh: dict[str, Urgency | None] = {}
        """Those that are free and may not have been offered all orders that wait, and up to which order they
        have been; None: from the first."""
        self._registry = registry
        self._consider = consider
        self._known: dict[str, LocatedCandidate] = {}
        self._unavailable: dict[ReasonKey, dict[str, None]] = {}

    def look_at(self, vehicle: FleetVehicle) -> bool:
        """Update a vehicle; return whether anything relevant for the assignment has changed."""
        name, found = vehicle.name, self._consider(vehicle)
        before = self._known.get(name)
        self._known[name] = found
        is_new = before is None or before.significant_fields != found.significant_fields
        self._group(before, found)
        if found.seen.soon:
            self.soon[name] = None
        else:
            self.soon.pop(name, None)
        if found.seen.obstacle:
            self.free.pop(name, None)
            self.fresh.pop(name, None)
        else:
            self.free[name] = found
            if is_new:
                self.fresh[name] = None
        if before and before.seen.obstacle and is_new:
            alike = self._unavailable[before.reason_key]
            del alike[name]
            if not alike:
                del self._unavailable[before.reason_key]
        if found.seen.obstacle and is_new:
            self._unavailable.setdefault(found.reason_key, {})[name] = None
        return is_new

    def _group(self, before: LocatedCandidate | None, found: LocatedCandidate) -> None:
        """Move a free vehicle to its kind in :attr:`alike`."""
        name = found.vehicle.name
        if before and not before.seen.obstacle and (alike := self.alike.get(before.free_kind)):
            alike.pop(name, None)
            if not alike:
                del self.alike[before.free_kind]
        if found.standing and not found.seen.obstacle:
            self.alike.setdefault(found.free_kind, {})[name] = found.standing.point

    def refresh(self, names: Iterable[str]) -> None:
        """Update the vehicles of these names."""
        for name in names:
            if (vehicle := self._registry.named(name)) and not vehicle.obstacle:
                self.look_at(vehicle)

    def offer_all(self) -> None:
        """Offer all waiting orders again to each free vehicle that is not being offered some already."""
        for name in self.free:
            self.fresh.setdefault(name, None)

    def take_hindmost(self) -> tuple[Urgency | None, list[str]]:
        """Remove the fresh vehicles that were offered the fewest orders.

        Return the last order they were offered, and their names.
        """
        begun = [each for each in self.fresh.values() if each is not None]
        after = min(begun) if begun and len(begun) == len(self.fresh) else None
        names = [name for name, known in self.fresh.items() if known == after]
        for name in names:
            del self.fresh[name]
        return after, names

    def offer_on(self, names: Iterable[str], after: Urgency) -> None:
        """Continue offering orders after this one to those of the vehicles that are still free."""
        for name in names:
            if name in self.free:
                self.fresh.setdefault(name, after)

    def get(self, name: str) -> LocatedCandidate | None:
        """Return the last view of a vehicle; None for one that never gets orders."""
        return self._known.get(name)

    def relevant(
        self, named: Iterable[str], free: Iterable[str] | None = None
    ) -> dict[str, LocatedCandidate]:
        """Return the free vehicles and those that soon will be, these, and one of each kind of the others.

        ``free`` are the free vehicles to return; None: all.
        """
        examples = [next(iter(each)) for each in self._unavailable.values()][:EXAMPLES_AT_MOST]
        free = self.free if free is None else free
        names = sorted({*free, *self.soon, *examples, *(name for name in named if name in self._known)})
        return {name: self._known[name] for name in names}
