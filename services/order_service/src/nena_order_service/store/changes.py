"""Changes to write: those of one unit of work, or of several that are committed together."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder

Document = Callable[[], str]
"""Serialises a document; called by the writer, because most changes are replaced before they are written."""


@dataclass(frozen=True, slots=True)
class OrderChange:
    """One order's new version; its first ``unchanged_history`` history entries are already stored."""

    order: TransportOrder
    new: bool
    unchanged_history: int
    change_number: int = 0
    """Number of this change among the changes of all orders."""


@dataclass(slots=True)
class Changes:
    """Changes to commit together; only the latest of each order counts."""

    orders: dict[int, OrderChange] = field(default_factory=dict)
    """Orders by number."""
    missions: dict[int, Document | None] = field(default_factory=dict)
    """Documents of sent orders by order number; None: ended."""
    vehicles: dict[str, Document] = field(default_factory=dict)
    """Documents of vehicles by robot key."""
    sequences: dict[int, OrderSequence] = field(default_factory=dict)
    """Order sequences by number."""
    path_locks: dict[str, bool] = field(default_factory=dict)
    """Whether a path is locked, by path name."""
    documents: dict[tuple[str, str], str | None] = field(default_factory=dict)
    """Documents uploaded by hosts, by kind and name; None: deleted."""

    def __bool__(self) -> bool:
        single = self.orders or self.missions or self.vehicles or self.sequences
        return bool(single or self.path_locks or self.documents)

    def put_order(self, order: TransportOrder, before: TransportOrder | None) -> None:
        """Add an order's new version; ``before`` is the previous one, None for a new order."""
        unchanged = _equal_entries(order, before) if before else 0
        earlier = self.orders.get(order.number)
        if earlier:
            change = OrderChange(order, earlier.new, min(earlier.unchanged_history, unchanged))
        else:
            change = OrderChange(order, before is None, unchanged)
        self.orders[order.number] = change

    def put_mission(self, order_number: int, document: Document | None) -> None:
        """Add the sent order of an order; None: nothing is sent any more."""
        self.missions[order_number] = document

    def put_vehicle(self, robot: str, document: Document) -> None:
        """Add a vehicle's record."""
        self.vehicles[robot] = document

    def put_sequence(self, sequence: OrderSequence) -> None:
        """Add an order sequence, or its new version."""
        self.sequences[sequence.number] = sequence

    def merge(self, later: Changes) -> None:
        """Add ``later`` changes, which replace these where they overlap."""
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
            self.orders[number] = OrderChange(change.order, change.new, change.unchanged_history, last)
        return last


def _equal_entries(order: TransportOrder, before: TransportOrder) -> int:
    """Return how many of the first entries are equal; entries never change, at most the last is replaced."""
    new, old = order.status.history, before.status.history
    if not old:
        return 0
    last = len(old) - 1
    return len(old) if len(new) > last and new[last] is old[last] else last


class ChangeNumbers:
    """Counts the changes of all orders of a store, across restarts and takeovers.

    They follow the order in which changes are committed and published. If a unit of work changes an order
    several times, all of these versions have the same number.
    """

    def __init__(self) -> None:
        self.last = 0
        """The last number assigned."""
        self.published = 0
        """The last number of a published change."""
        self._untold: dict[str, deque[tuple[int, int]]] = {}
        """Unpublished versions and their numbers, by order name."""

    def give(self, changes: Changes) -> None:
        """Number the changes of a unit of work."""
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

        Versions are published in order. The number is 0 for a version that is published without a change.
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
