"""Times of orders: deadlines and timeouts, and which of them have passed."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from heapq import heapify, heappop, heappush

from nena_order_service.orders.transport_order import TransportOrder

FIRST_SWEEP = 64
"""How many are watched before any are looked at again."""


class DueTimes:
    """Knows one time of each order that is watched.

    The ends of orders need not be reported: what is watched of orders that are over is dropped whenever
    there is twice as much as the last time.
    """

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` returns whether the order of a number has ended."""
        self._is_over = is_over
        self._times: dict[int, datetime] = {}
        self._queue: list[tuple[datetime, int]] = []
        self._sweep_at = FIRST_SWEEP

    def __len__(self) -> int:
        """Return how much is kept."""
        return len(self._queue)

    def watch(self, number: int, time: datetime) -> None:
        """Watch an order, in place of what was watched of it before."""
        if self._times.get(number) == time:
            return
        self._times[number] = time
        heappush(self._queue, (time, number))
        if len(self._queue) >= self._sweep_at:
            self._sweep()

    def take(self, now: datetime) -> list[int]:
        """Return the numbers of the orders whose times have come, once each; some may be over."""
        due: list[int] = []
        while self._queue and self._queue[0][0] <= now:
            time, number = heappop(self._queue)
            if self._times.get(number) == time:
                del self._times[number]
                due.append(number)
        return due

    def _sweep(self) -> None:
        self._times = {number: time for number, time in self._times.items() if not self._is_over(number)}
        self._queue = [(time, number) for number, time in self._times.items()]
        heapify(self._queue)
        self._sweep_at = max(FIRST_SWEEP, 2 * len(self._queue))


class Deadlines:
    """Watches the deadlines of orders; one that ends before is passed over."""

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` returns whether the order of a number has ended."""
        self._times = DueTimes(is_over)

    def watch(self, order: TransportOrder) -> None:
        """Watch the deadline of an order, if it has one."""
        if order.status.deadline is not None and not order.status.late:
            self._times.watch(order.number, order.status.deadline)

    def passed(self, now: datetime) -> list[int]:
        """Return the numbers of the orders whose deadlines have passed since this was asked last."""
        return self._times.take(now - timedelta.resolution)  # who is done in the very moment is in time


class OrderTimeouts:
    """Knows when orders are due to be ended, in UTC, so that restarts change nothing about it."""

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` returns whether the order of a number has ended."""
        self._times = DueTimes(is_over)

    def watch(self, order: TransportOrder) -> None:
        """Handle an order that is new, or that was given to a vehicle."""
        if end := _end(order):
            self._times.watch(order.number, end)

    def take_due(self, now: datetime) -> list[int]:
        """Return the numbers of orders whose time is over, once each; some may have ended before."""
        return self._times.take(now)


def reason(order: TransportOrder, now: datetime) -> str:
    """Return which time has gone by."""
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
