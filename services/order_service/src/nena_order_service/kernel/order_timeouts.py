"""Which orders have had their time."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

from nena_order_service.orders.transport_order import TransportOrder


class OrderTimeouts:
    """Knows when orders are due to be ended, in UTC, so that restarts change nothing about it."""

    def __init__(self) -> None:
        self._ends: dict[int, datetime] = {}

    def watch(self, order: TransportOrder) -> None:
        """Take notice of an order that is new, or that was given to a vehicle."""
        if end := _end(order):
            self._ends[order.number] = end

    def take_due(self, now: datetime) -> Iterator[int]:
        """Give the numbers of orders whose time is over, once each; some may have ended before."""
        due = [number for number, end in self._ends.items() if end <= now]
        for number in due:
            del self._ends[number]
        yield from due


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
