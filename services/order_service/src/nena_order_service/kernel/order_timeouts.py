"""Which orders have had their time."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

from nena_order_service.kernel.due_times import DueTimes
from nena_order_service.orders.transport_order import TransportOrder


class OrderTimeouts:
    """Knows when orders are due to be ended, in UTC, so that restarts change nothing about it."""

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` tells whether the order of a number is at its end."""
        self._times = DueTimes(is_over)

    def watch(self, order: TransportOrder) -> None:
        """Take notice of an order that is new, or that was given to a vehicle."""
        if end := _end(order):
            self._times.watch(order.number, end)

    def take_due(self, now: datetime) -> list[int]:
        """Give the numbers of orders whose time is over, once each; some may have ended before."""
        return self._times.take(now)


def reason(order: TransportOrder, now: datetime) -> str:
    """Say which time has gone by."""
    status = order.status
    if status.timeout is not None and status.created + timedelta(seconds=status.timeout) <= now:
        return f"time-out: it was not done within {status.timeout:g} s of its creation"
    return f"time-out: it was not done within {status.processing_timeout:g} s of when a vehicle got it"


def _end(order: TransportOrder) -> datetime | None:
    status = order.status
    ends = (
        start + timedelta(seconds=seconds)
        for start, seconds in ((status.created, status.timeout), (status.assigned, status.processing_timeout))
        if start is not None and seconds is not None
    )
    return min(ends, default=None)
