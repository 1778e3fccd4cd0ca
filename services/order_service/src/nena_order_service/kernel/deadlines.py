"""Deadlines of orders: which of them have passed."""

from __future__ import annotations

from datetime import datetime
from heapq import heappop, heappush

from nena_order_service.orders.transport_order import TransportOrder


class Deadlines:
    """Watches the deadlines of orders; one that ends before is passed over then."""

    def __init__(self) -> None:
        self._next: list[tuple[datetime, int]] = []

    def watch(self, order: TransportOrder) -> None:
        """Watch the deadline of an order, if it has one."""
        if order.status.deadline is not None and not order.status.late:
            heappush(self._next, (order.status.deadline, order.number))

    def passed(self, now: datetime) -> list[int]:
        """Give the numbers of the orders whose deadlines have passed since this was asked last."""
        found: list[int] = []
        while self._next and self._next[0][0] < now:
            found.append(heappop(self._next)[1])
        return found
