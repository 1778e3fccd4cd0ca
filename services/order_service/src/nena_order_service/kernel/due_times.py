"""When something is due for orders; bounded by the orders that are not at their end."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from heapq import heapify, heappop, heappush

FIRST_SWEEP = 64
"""How many are watched before any are looked at again."""


class DueTimes:
    """Knows one time of each order that is watched.

    Nobody has to tell of the ends of orders: what is watched of orders that are over is dropped whenever
    there is twice as much as the last time.
    """

    def __init__(self, is_over: Callable[[int], bool]) -> None:
        """``is_over`` tells whether the order of a number is at its end."""
        self._is_over = is_over
        self._times: dict[int, datetime] = {}
        self._queue: list[tuple[datetime, int]] = []
        self._sweep_at = FIRST_SWEEP

    def __len__(self) -> int:
        """Give how much is kept."""
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
        """Give the numbers of the orders whose times have come, once each; some may be over."""
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
