"""The two sides of an assignment: orders that wait, and vehicles as the dispatcher sees them."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import NamedTuple

from nena_order_service.orders.transport_order import TransportOrder, Urgency
from nena_order_service.orders.vda_orders import Pick
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.transport_order import Destination, TransportOrderState
from nena_shared.fleet_api.vehicle import ANY_ORDER_TYPE, ANY_TYPE, AcceptableOrderType
from nena_shared.plant.model import EnergyThresholds
from nena_shared.vda5050.action import LOAD_HANDLING_DEVICE
from nena_shared.vda5050.factsheet import Factsheet
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
    """Return the kind of an order; it stays the same while the order waits, unless it is intended anew."""
    status = order.status
    return OrderKind(
        status.intended_vehicle,
        status.wrapping_sequence,
        tuple(status.excluded_vehicles),
        status.type,
        status.dispensable,
        status.automatic,
        tuple(map(_demand_of, stops_of(order))),
    )


def stops_of(order: TransportOrder) -> list[Destination]:
    """Return the destinations that have not been reached yet."""
    return [drive.destination for drive in order.status.drive_orders[order.index :]]


def _demand_of(destination: Destination) -> tuple[str, str, str]:
    values = {prop.key: prop.text for prop in destination.properties}
    device = next((values[key] for key in LOAD_HANDLING_DEVICE if key in values), "")
    return destination.operation, values.get("loadType", ""), device


class WaitingOrders:
    """The orders that wait for a vehicle, held ones included, most urgent first."""

    def __init__(self) -> None:
        self._queue: list[Urgency] = []
        self._urgencies: dict[int, Urgency] = {}
        self._kinds: dict[int, OrderKind] = {}

    def __len__(self) -> int:
        """Return how many orders wait."""
        return len(self._queue)

    def __iter__(self) -> Iterator[int]:
        """Yield the numbers of the orders, most urgent first."""
        return (urgency[-1] for urgency in self._queue)

    @property
    def oldest(self) -> int | None:
        """Number of the order that was created first, whenever it was queued; None: no order waits."""
        return min(self._urgencies, default=None)

    def put(self, order: TransportOrder) -> None:
        """Keep an order exactly while it is dispatchable; meanwhile its vehicle and urgency may change."""
        number, waits = order.number, order.state is TransportOrderState.DISPATCHABLE
        urgency, before = order.urgency if waits else None, self._urgencies.get(number)
        if before is not None and before != urgency:
            del self._queue[bisect_left(self._queue, before)], self._urgencies[number]
            if not waits:
                del self._kinds[number]
        if urgency is not None and before != urgency:
            self._urgencies[number] = urgency
            insort(self._queue, urgency)
        if waits:
            kind = self._kinds.get(number)
            if kind is None or kind.intended_vehicle != order.status.intended_vehicle:
                self._kinds[number] = kind_of(order)

    def kind_of(self, order: TransportOrder) -> OrderKind:
        """Return the kind of an order, which need not wait."""
        return self._kinds.get(order.number) or kind_of(order)


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

    def has_recharged(self, *, fully: bool) -> bool:
        """Whether it has recharged enough to take an order, or ``fully``."""
        wanted = self.thresholds.fully_recharged if fully else self.thresholds.sufficiently_recharged
        return self.level >= wanted and not self.critical

    def restriction(self, *, fully: bool) -> Reason | None:
        """Return, as a predicate, why it only takes orders to recharge; None if it takes any order.

        ``fully``: a charging vehicle continues until it is fully recharged, not just sufficiently. The text
        stays the same while the energy changes.
        """
        # As in openTCS: a charging vehicle goes on until it has enough, so that it does not come back soon.
        levels = self.thresholds
        if self.charging and not self.has_recharged(fully=fully):
            until = levels.fully_recharged if fully else max(levels.sufficiently_recharged, levels.critical)
            return Reason(R.RECHARGES, level=until)
        if self.critical:
            return Reason(R.MUST_RECHARGE, level=levels.critical)
        return None


def order_types_named(names: Iterable[str] | None) -> tuple[AcceptableOrderType, ...]:
    """Return types by name, in order of preference; None: any type is accepted."""
    if names is None:
        return ANY_ORDER_TYPE
    return tuple(AcceptableOrderType(name=name, priority=index) for index, name in enumerate(names))


def type_priority(accepted: Iterable[AcceptableOrderType], order_type: str) -> int | None:
    """Return the vehicle's priority for orders of this type, lower is preferred; None: type not accepted.

    The priority of the exact type overrides that of any type (``*``).
    """
    priorities = {accepted_type.name: accepted_type.priority for accepted_type in accepted}
    return priorities.get(order_type, priorities.get(ANY_TYPE))


def why_not_accepted(accepted: Sequence[AcceptableOrderType], order_type: str) -> Reason | None:
    """Return, as a predicate, why a vehicle takes no orders of this type; None if it does."""
    if type_priority(accepted, order_type) is not None:
        return None
    if not accepted:
        return Reason(R.ACCEPTS_NO_TYPE)
    names = ", ".join(
        repr(accepted_type.name)
        for accepted_type in sorted(accepted, key=lambda accepted_type: accepted_type.priority)
    )
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

    def why_no_room(self, pick: Pick) -> Reason | None:
        """Return, as a predicate, why there is no room for a load; None if there may be.

        A vehicle without known load positions has one; a load without a position may be on any of them.
        """
        if pick.place:
            wanted, elsewhere = frozenset({pick.place}), frozenset(self.loads) - {"", pick.place}
        else:
            wanted = self.places_of.get(pick.load_type, self.places)
            elsewhere = self.places - wanted
        if sum(load not in elsewhere for load in self.loads) < max(len(wanted), 1):
            return None
        where = [Reason(R.AT_PLACE, place=pick.place)] if pick.place else []
        if len(self.loads) == 1:
            return Reason(R.LOADED, *where)
        return Reason(R.LOADED_SEVERAL, *where, count=len(self.loads))


def reported_loads(state: State, factsheet: Factsheet | None) -> Carried | None:
    """Return the loads that a robot reports; None if it has none or cannot report them."""
    if not state.loads:
        return None
    loads = tuple(load.load_position or "" for load in state.loads)
    loading = factsheet.load_specification if factsheet else None
    if loading is None or not loading.load_positions:
        return Carried(loads)
    all_places, places_of = frozenset(loading.load_positions), dict[str, frozenset[str]]()
    for load_set in loading.load_sets or ():
        # VDA 5050 2.1, loadSets.loadPositions: a set without positions is valid for all of them.
        places = all_places.intersection(load_set.load_positions or all_places)
        places_of[load_set.load_type] = places_of.get(load_set.load_type, frozenset()) | places
    return Carried(loads, all_places, places_of)


RESERVED = Reason(R.RESERVED)
DISPENSABLE = Reason(R.HAS_DISPENSABLE_ORDER)


class DispatchedVehicle(NamedTuple):
    """Whether a vehicle takes orders now, and which; reasons are predicates such as "is offline"."""

    name: str
    obstacle: Reason | None = None
    """Why it takes no order at all; None if it may."""
    restriction: Reason | None = None
    """Why it only takes orders to recharge; None if it takes others too."""
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
    sequence: str | None = None
    """The order sequence to which it is bound."""
    start: str = ""
    """The point from which its route would begin; empty with an obstacle."""
    routing_kind: int = 0
    """Number of its kind for the router: those of one kind have the same routes."""

    @property
    def group(self) -> tuple[object, ...]:
        """Everything that decides which orders it takes, unless they name it, and which routes it has."""
        return (
            self.obstacle,
            self.restriction,
            bool(self.gives_up),
            self.kept_for,
            self.order_types,
            self.carried,
            self.sequence,
            self.routing_kind,
        )

    def type_priority(self, order: TransportOrder) -> float:
        """Return the priority of orders of this type, less is better; infinity: not accepted."""
        priority = type_priority(self.order_types, order.status.type)
        return inf if priority is None else priority

    def why_not(self, order: TransportOrder, *, recharges: bool, pick: Pick | None = None) -> Reason | None:
        """Return, as a predicate, why it does not take this order now; None if it may.

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
        return self.carried.why_no_room(pick) if self.carried and pick else None
