"""The dispatcher: decides which vehicle does which order now, and says in words why the others wait."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from math import inf
from types import MappingProxyType
from typing import Final, Protocol

from nena_order_service.dispatch.comparators import (
    Candidate,
    CandidateKey,
    Now,
    OrderKey,
    Rank,
    rank_candidates,
    rank_orders,
    rank_vehicles,
)
from nena_order_service.dispatch.load_room import Pick
from nena_order_service.dispatch.settings import Chooser, DispatchSettings
from nena_order_service.dispatch.vehicle import DispatchedVehicle
from nena_order_service.dispatch.way_costs import WayCost
from nena_order_service.orders.transport_order import TransportOrder

BUSY: Final = "works on another order"

URGENCY: Final = (OrderKey.BY_PRIORITY, OrderKey.BY_DEADLINE, OrderKey.BY_AGE)
"""The keys that :attr:`TransportOrder.urgency` stands for."""

KINDS_NAMED: Final = 5
"""Kinds of obstacles that a reason names at most."""

NOBODY: Final[Mapping[int, str]] = MappingProxyType({})


class Knowledge(Protocol):
    """What the dispatcher asks about an order and a vehicle."""

    def misfit(self, order: TransportOrder, vehicle: str) -> str:
        """Say, as a predicate, why a vehicle must not do an order, whatever it does now; empty where it may.

        Of two orders of one kind (see :func:`_kind`) it says the same.
        """
        ...

    def recharges(self, order: TransportOrder) -> bool:
        """Tell whether the next thing that an order asks for is to recharge."""
        ...

    def pick(self, order: TransportOrder) -> Pick | None:
        """Give what an order begins with picking up; None: it picks up nothing, or drops something first."""
        ...

    def cost(self, order: TransportOrder, vehicle: str) -> WayCost:
        """Give the cost of a vehicle's way through an order's destinations; infinity where there is none."""
        ...

    def why_no_way(self, order: TransportOrder, vehicle: str) -> str:
        """Say why there is no way."""
        ...


@dataclass(frozen=True, slots=True)
class Assignment:
    """One order for one vehicle."""

    order: TransportOrder
    vehicle: str
    why: str
    """Why this vehicle."""
    gives_up: str = ""
    """Name of the dispensable order that the vehicle has to give up first; empty: it has none."""


@dataclass(slots=True)
class Decisions:
    """What is to be done now, and why all the rest is not."""

    assignments: list[Assignment] = field(default_factory=list)
    reasons: dict[str, str] = field(default_factory=dict)
    """Why each order that was not assigned waits, by its name; words that stay the same while they hold."""


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
        kept: Mapping[int, str] = NOBODY,
    ) -> Decisions:
        """Assign what can be assigned of the dispatchable ``orders``, which come by their urgency.

        ``kept`` names vehicles that give up dispensable orders for orders, by the orders' numbers: they do
        these, and nobody else does. An order is never given to two vehicles, nor two to one.
        """
        settings = self.settings
        moment = Now(now, timedelta(seconds=settings.deadline_at_risk))
        waiting = self._sorted(orders, moment, kept)
        found = _Round(settings, {each.name: each for each in vehicles}, knowledge, moment, kept)
        if settings.choosers is Chooser.SCARCER and found.free < len(waiting):
            found.let_vehicles_choose(waiting)
        found.let_orders_choose(waiting)
        return found.decisions

    def _sorted(
        self, orders: Iterable[TransportOrder], now: Now, kept: Mapping[int, str]
    ) -> Sequence[TransportOrder]:
        """Give the orders in the order in which they choose; first those for which vehicles are kept."""
        by_urgency = tuple(self.settings.orders) == URGENCY
        waiting = [*orders] if by_urgency else sorted(orders, key=rank_orders(self.settings.orders, now))
        return sorted(waiting, key=lambda order: order.number not in kept) if kept else waiting


class _Round:
    """One decision in the making."""

    def __init__(
        self,
        settings: DispatchSettings,
        vehicles: dict[str, DispatchedVehicle],
        knowledge: Knowledge,
        now: Now,
        kept: Mapping[int, str],
    ) -> None:
        self.decisions = Decisions()
        self._settings = settings
        self._vehicles = vehicles
        self._knowledge = knowledge
        self._now = now
        self._kept = kept
        self._assigned: set[int] = set()
        self._restricted = any(each.restriction for each in vehicles.values())
        self._loaded = any(each.carried for each in vehicles.values())

    @property
    def free(self) -> int:
        """How many vehicles take orders."""
        return sum(not each.obstacle for each in self._vehicles.values())

    def let_vehicles_choose(self, orders: Sequence[TransportOrder]) -> None:
        """Let each vehicle that is free take the order that suits it best."""
        free = [each for each in self._vehicles.values() if not each.obstacle]
        keys = self._settings.order_candidates
        rank = rank_candidates(keys, self._now)
        for vehicle in sorted(free, key=rank_vehicles(self._settings.vehicles)):
            fitting = (each for each in orders if each.number not in self._assigned)
            pairs = [*self._possible((each, vehicle) for each in fitting if not self._why_not(each, vehicle))]
            if pairs:
                self._assign(min(pairs, key=rank), f"first by {keys[0]} of {len(pairs)} orders for it")

    def let_orders_choose(self, orders: Sequence[TransportOrder]) -> None:
        """Let each order that is left take the vehicle that suits it best; else say why it waits."""
        rank = rank_candidates(self._settings.vehicle_candidates, self._now)
        nobody: dict[_Kind, str] = {}
        for order in orders:
            if order.number in self._assigned:
                continue
            kind = (*_kind(order), self._recharges(order), self._pick(order))
            if kind in nobody and order.number not in self._kept:
                self.decisions.reasons[order.name] = nobody[kind]
                continue
            hindrances = {each.name: self._why_not(order, each) for each in self._meant(order)}
            free = [name for name, hindrance in hindrances.items() if not hindrance]
            if free:
                self._choose(order, free, rank)
                continue
            reason = self.decisions.reasons[order.name] = _nobody_free(self._intended(order), hindrances)
            if order.number not in self._kept:
                nobody[kind] = reason

    def _choose(self, order: TransportOrder, free: Sequence[str], rank: Callable[[Candidate], Rank]) -> None:
        pairs = [*self._possible((order, self._vehicles[name]) for name in free)]
        if pairs:
            best = min(pairs, key=rank)
            self._assign(best, self._why(best, len(free)))
        else:
            why = self._knowledge.why_no_way(order, free[-1])
            self.decisions.reasons[order.name] = f"waits, for vehicle {free[-1]!r} has no way: {why}"

    def _possible(self, pairs: Iterable[tuple[TransportOrder, DispatchedVehicle]]) -> Iterator[Candidate]:
        for order, vehicle in pairs:
            cost = self._knowledge.cost(order, vehicle.name)
            if cost.complete < inf:
                yield Candidate(order, vehicle, cost)

    def _assign(self, pair: Candidate, why: str) -> None:
        order, vehicle = pair.order, pair.vehicle
        self._assigned.add(order.number)
        self._vehicles[vehicle.name] = replace(vehicle, obstacle=BUSY)
        self.decisions.assignments.append(Assignment(order, vehicle.name, why, vehicle.gives_up))

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
            return "is not the vehicle that is asked for"
        misfit = self._knowledge.misfit(order, vehicle.name)
        if misfit:
            return misfit
        return vehicle.why_not(order, recharges=self._recharges(order), pick=self._pick(order))

    def _recharges(self, order: TransportOrder) -> bool:
        """Tell whether an order is one to recharge, where that makes a difference."""
        return self._restricted and self._knowledge.recharges(order)

    def _pick(self, order: TransportOrder) -> Pick | None:
        """Give what an order begins with picking up, where that makes a difference."""
        return self._knowledge.pick(order) if self._loaded else None

    def _why(self, best: Candidate, choices: int) -> str:
        if self._intended(best.order) is not None:
            return "it is the intended vehicle"
        if choices == 1:
            return "it is the only vehicle that is free"
        key = self._settings.vehicle_candidates[0]
        if key is CandidateKey.BY_COMPLETE_ROUTING_COSTS:
            return f"cheapest way ({best.cost.complete:.0f}) of {choices} vehicles that are free"
        return f"first by {key} of {choices} vehicles that are free"


_Kind = tuple[object, ...]
"""What an order says about who may do it."""


def _kind(order: TransportOrder) -> _Kind:
    status = order.status
    who = (status.intended_vehicle, status.wrapping_sequence, status.excluded_vehicles)
    return *who, status.type, status.dispensable, status.automatic


def _nobody_free(intended: str | None, hindrances: Mapping[str, str]) -> str:
    if intended is not None:
        return f"waits for vehicle {intended!r}, which {hindrances.get(intended, 'takes no orders')}"
    if not hindrances:
        return "waits for a vehicle: the plant model has none that takes orders"
    kinds = sorted(set(hindrances.values()))
    more = " or something else" if len(kinds) > KINDS_NAMED else ""
    return f"waits for a vehicle: each of them {' or '.join(kinds[:KINDS_NAMED])}{more}"
