"""What is to be written: the changes of one unit of work, or of many that are committed together."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder

Document = Callable[[], str]
"""Serialises what is to be stored; called by the writer, because most changes are replaced before that."""


@dataclass(frozen=True, slots=True)
class OrderChange:
    """One order's new version; entries of its history before ``unchanged_history`` are stored already."""

    order: TransportOrder
    new: bool
    unchanged_history: int
    change_number: int = 0
    """Counts the changes of all orders; from the store."""


@dataclass(slots=True)
class Changes:
    """Changes to commit together; the latest of each order counts."""

    orders: dict[int, OrderChange] = field(default_factory=dict)
    """By the orders' numbers."""
    missions: dict[int, Document | None] = field(default_factory=dict)
    """Mission documents by the orders' numbers; None: it is at its end."""
    vehicles: dict[str, Document] = field(default_factory=dict)
    """Documents of vehicles by their robots' keys."""
    sequences: dict[int, OrderSequence] = field(default_factory=dict)
    """Order sequences by their numbers."""
    path_locks: dict[str, bool] = field(default_factory=dict)
    """Whether a path is locked, by its name."""
    documents: dict[tuple[str, str], str | None] = field(default_factory=dict)
    """What hosts have put here as a whole, by kind and name; None: it is deleted."""

    def __bool__(self) -> bool:
        single = self.orders or self.missions or self.vehicles or self.sequences
        return bool(single or self.path_locks or self.documents)

    def put_order(self, order: TransportOrder, before: TransportOrder | None) -> None:
        """Add an order's new version; ``before`` is the last one, None for an order that is new."""
        unchanged = _equal_entries(order, before) if before else 0
        earlier = self.orders.get(order.number)
        if earlier:
            change = OrderChange(order, earlier.new, min(earlier.unchanged_history, unchanged))
        else:
            change = OrderChange(order, before is None, unchanged)
        self.orders[order.number] = change

    def put_mission(self, order_number: int, document: Document | None) -> None:
        """Add what is sent for an order, or None if nothing is any more."""
        self.missions[order_number] = document

    def put_vehicle(self, robot: str, document: Document) -> None:
        """Add a vehicle's record."""
        self.vehicles[robot] = document

    def put_sequence(self, sequence: OrderSequence) -> None:
        """Add an order sequence, or its new version."""
        self.sequences[sequence.number] = sequence

    def merge(self, later: Changes) -> None:
        """Handle changes that were made after these."""
        for number, change in later.orders.items():
            earlier = self.orders.get(number)
            if earlier:
                unchanged = min(earlier.unchanged_history, change.unchanged_history)
                change = replace(change, new=earlier.new, unchanged_history=unchanged)  # noqa: PLW2901 - merged
            self.orders[number] = change
        self.missions.update(later.missions)
        self.vehicles.update(later.vehicles)
        self.sequences.update(later.sequences)
        self.path_locks.update(later.path_locks)
        self.documents.update(later.documents)

    def numbered(self, last: int) -> int:
        """Number each order's change, starting after ``last``; return the last number."""
        for number, change in self.orders.items():
            last += 1
            self.orders[number] = replace(change, change_number=last)
        return last


def _equal_entries(order: TransportOrder, before: TransportOrder) -> int:
    """Count the first entries that both have; an entry is never changed, at most the last is replaced."""
    new, old = order.status.history, before.status.history
    if not old:
        return 0
    last = len(old) - 1
    return len(old) if len(new) > last and new[last] is old[last] else last


class ChangeNumbers:
    """Counts the changes of all orders of a store, across restarts and takeovers.

    They follow the order in which changes are committed and published; a unit of work that changes an order
    several times has one number for all of its versions.
    """

    def __init__(self) -> None:
        self.last = 0
        """The last number given."""
        self.published = 0
        """The last number of a published change."""
        self._untold: dict[str, deque[tuple[int, int]]] = {}
        """Versions and their numbers, by the orders' names."""

    def give(self, changes: Changes) -> None:
        """Number the changes of a step."""
        self.last = changes.numbered(self.last)
        for change in changes.orders.values():
            order = change.order
            versions = self._untold.setdefault(order.name, deque())
            versions.append((order.status.version, change.change_number))

    def begin(self, last: int) -> None:
        """Continue after the last number of the store."""
        self.last = self.published = last

    def of(self, name: str, version: int) -> tuple[int, bool]:
        """Return the number of a version to publish now, and whether it is the last version of its change.

        Versions are published in their order. The number is 0 for one that is published without a change.
        """
        versions = self._untold.get(name)
        while versions and versions[0][0] < version:
            versions.popleft()
        if not versions:
            self._untold.pop(name, None)
            return 0, False
        last_version, number = versions[0]
        if last_version > version:
            return number, False
        self.published = number
        versions.popleft()
        if not versions:
            del self._untold[name]
        return number, True
