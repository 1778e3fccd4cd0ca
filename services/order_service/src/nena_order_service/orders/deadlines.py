"""Times of orders: deadlines and timeouts, and which of them have passed."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta
from heapq import heapify, heappop, heappush

from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.fleet_api.reasons import Reason, ReasonCode

R = ReasonCode

FIRST_SWEEP = 64
"""Number of watched orders before ended ones are removed."""


class DueTimes:
    """Keeps one time of each watched order.

    Ended orders need not be reported: their entries are dropped whenever the number of entries has doubled.
    """

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` returns whether the order of a number has ended."""
        self._is_over = is_over
        self._times: dict[int, datetime] = {}
        self._queue: list[tuple[datetime, int]] = []
        self._sweep_at = FIRST_SWEEP

    def __len__(self) -> int:
        """Return the number of entries."""
        return len(self._queue)

    def watch(self, number: int, time: datetime | None) -> None:
        """Watch an order, replacing its earlier entry; None: no longer."""
        if self._times.get(number) == time:
            return
        if time is None:
            del self._times[number]
            return
        self._times[number] = time
        heappush(self._queue, (time, number))
        if len(self._queue) >= self._sweep_at:
            # Replaced entries stay in a heap until they come up, and ended orders are never reported.
            self._times = {number: time for number, time in self._times.items() if not self._is_over(number)}
            self._queue = [(time, number) for number, time in self._times.items()]
            heapify(self._queue)
            self._sweep_at = max(FIRST_SWEEP, 2 * len(self._queue))

    def take(self, now: datetime) -> list[int]:
        """Remove and return the numbers of the orders that are due, once each; some may have ended."""
        due: list[int] = []
        while self._queue and self._queue[0][0] <= now:
            time, number = heappop(self._queue)
            if self._times.get(number) == time:
                del self._times[number]
                due.append(number)
        return due


def deadline_of(order: TransportOrder) -> datetime | None:
    """Return the deadline of an order that is not late yet; None: it has none."""
    return None if order.status.late else order.status.deadline


def reason(order: TransportOrder, now: datetime) -> Reason:
    """Return which of the order's times has passed."""
    status = order.status
    if status.timeout is not None and status.created + timedelta(seconds=status.timeout) <= now:
        return Reason(R.NOT_DONE_SINCE_CREATION, limit=status.timeout)
    return Reason(R.NOT_DONE_SINCE_ASSIGNMENT, limit=status.processing_timeout or 0.0)


def timeout_of(order: TransportOrder) -> datetime | None:
    """Return when an order times out, in UTC, so that restarts do not change it; None: never."""
    status = order.status
    ends = (
        start + timedelta(seconds=seconds)
        for start, seconds in ((status.created, status.timeout), (status.assigned, status.processing_timeout))
        if start is not None and seconds is not None
    )
    return min(ends, default=None)
