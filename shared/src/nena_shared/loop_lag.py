"""Measure the lag of the event loop, which delays every request and every robot."""

from __future__ import annotations

import asyncio
from collections import deque

from nena_shared.clock import Clock

INTERVAL = 0.1
"""Interval between measurements, seconds; shorter delays may go unnoticed."""

WINDOW = 60.0
"""Period covered by the maximum, seconds."""


class LoopLag:
    """Measures how late a scheduled task runs."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._longest: deque[tuple[float, float]] = deque()
        """Times and delays of measurements not exceeded by a later one, longest first."""

    @property
    def longest(self) -> float:
        """Longest delay of the last minute, seconds; 0 before the first measurement."""
        self._forget_old(self._clock.monotonic())
        return self._longest[0][1] if self._longest else 0.0

    def note(self, delay: float) -> None:
        """Add a measured delay, seconds."""
        now = self._clock.monotonic()
        self._forget_old(now)
        while self._longest and self._longest[-1][1] <= delay:
            self._longest.pop()
        self._longest.append((now, delay))

    async def run(self) -> None:
        """Measure until cancelled."""
        while True:
            due = self._clock.monotonic() + INTERVAL
            await asyncio.sleep(INTERVAL)
            self.note(max(0.0, self._clock.monotonic() - due))

    def _forget_old(self, now: float) -> None:
        while self._longest and self._longest[0][0] < now - WINDOW:
            self._longest.popleft()
