"""The vehicles as the dispatcher sees them, updated only when something about them changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from nena_order_service.dispatching.dispatcher import DispatchedVehicle
from nena_order_service.fleet.position import Standing
from nena_order_service.fleet.robot import RobotView
from nena_order_service.orders.transport_order import Urgency
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.fleet_api.vehicle import AcceptableOrderType

EXAMPLES_AT_MOST = 50
"""Maximum vehicles checked for why none accepts an order; equal reasons count once."""


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

    @property
    def significant_fields(self) -> tuple[object, ...]:
        """Return what is relevant for the assignment of orders; energy alone is not."""
        where = self.standing and self.standing.point
        return *self.reason_key, self.seen.restriction, self.seen.gives_up, self.seen.carried, where

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

    def relevant(self, named: Iterable[str]) -> dict[str, LocatedCandidate]:
        """Return the free vehicles and those that soon will be, these, and one of each kind of the others."""
        examples = [next(iter(each)) for each in self._unavailable.values()][:EXAMPLES_AT_MOST]
        names = sorted({*self.free, *self.soon, *examples, *(name for name in named if name in self._known)})
        return {name: self._known[name] for name in names}
