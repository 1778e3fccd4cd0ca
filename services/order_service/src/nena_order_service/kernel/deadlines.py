"""Deadlines of orders: which of them have passed."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

from nena_order_service.kernel.due_times import DueTimes
from nena_order_service.orders.transport_order import TransportOrder


class Deadlines:
    """Watches the deadlines of orders; one that ends before is passed over."""

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` tells whether the order of a number is at its end."""
        self._times = DueTimes(is_over)

    def watch(self, order: TransportOrder) -> None:
        """Watch the deadline of an order, if it has one."""
        if order.status.deadline is not None and not order.status.late:
            self._times.watch(order.number, order.status.deadline)

    def passed(self, now: datetime) -> list[int]:
        """Give the numbers of the orders whose deadlines have passed since this was asked last."""
        return self._times.take(now - timedelta.resolution)  # who is done in the very moment is in time
