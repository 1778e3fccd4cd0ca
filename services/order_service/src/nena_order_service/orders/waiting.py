"""Index of the orders that wait for a vehicle, by urgency and by kind."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Iterator
from heapq import merge
from itertools import islice
from typing import NamedTuple

from nena_order_service.orders.transport_order import TransportOrder, Urgency
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.action import LOAD_HANDLING_DEVICE


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
        self._for_any: dict[OrderKind, None] = {}
        """Kinds that name no vehicle."""
        self._for_one: dict[str, dict[OrderKind, None]] = {}
        """Kinds that name a vehicle, by vehicle name."""

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
        """Yield the kinds of orders that wait for any vehicle or for one of these."""
        yield from tuple(self._for_any)
        for vehicle in vehicles:
            yield from tuple(self._for_one.get(vehicle, ()))

    def naming(self, vehicle: str) -> Iterator[OrderKind]:
        """Yield the kinds of orders that wait for this vehicle only."""
        return iter(tuple(self._for_one.get(vehicle, ())))

    def example(self, kind: OrderKind) -> int:
        """Return the number of the most urgent order of a kind."""
        return self._kinds[kind][0][-1]

    def first(self, kinds: Iterable[OrderKind], limit: int, after: Urgency | None = None) -> list[int]:
        """Return the numbers of the most urgent orders of these kinds that come after ``after``."""
        rows = [self._kinds[kind] for kind in kinds]
        if after is None:
            parts: Iterable[Iterable[Urgency]] = (row[:limit] for row in rows)
        else:
            starts = ((row, bisect_right(row, after)) for row in rows)
            parts = (row[start : start + limit] for row, start in starts)
        return [urgency[-1] for urgency in islice(merge(*parts), limit)]

    def part(self, start: int, limit: int) -> list[int]:
        """Return the numbers of ``limit`` orders from position ``start`` of the queue, held ones included."""
        return [urgency[-1] for urgency in self._queue[start : start + limit]]

    def _offer(self, number: int, kind: OrderKind) -> None:
        self._kind_of[number] = kind
        self.fresh[number] = None
        if kind not in self._kinds:
            self._kinds[kind] = []
            self._same_vehicle(kind)[kind] = None
        insort(self._kinds[kind], self._urgencies[number])

    def _take_back(self, number: int, kind: OrderKind) -> None:
        self.fresh.pop(number, None)
        _remove(self._kinds[kind], self._urgencies[number])
        if not self._kinds[kind]:
            del self._kinds[kind]
            same = self._same_vehicle(kind)
            del same[kind]
            if not same and kind.intended_vehicle is not None:
                del self._for_one[kind.intended_vehicle]

    def _same_vehicle(self, kind: OrderKind) -> dict[OrderKind, None]:
        if kind.intended_vehicle is None:
            return self._for_any
        return self._for_one.setdefault(kind.intended_vehicle, {})


def _remove(row: list[Urgency], urgency: Urgency) -> None:
    del row[bisect_left(row, urgency)]
