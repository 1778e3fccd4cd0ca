"""The pace of a load: a fixed number per second, however long each takes to send."""

from __future__ import annotations

import time

from support.pausing import pass_time, time_passes


class Pace:
    """Runs at ``rate`` per second; delays are caught up."""

    def __init__(self, rate: float) -> None:
        self._start = time.perf_counter()
        self._rate = rate

    def keep(self, count: int) -> None:
        """Keep the thread waiting until the one of this number is due, from 0 on."""
        pass_time(self._left(count))

    async def kept(self, count: int) -> None:
        """Wait until the one of this number is due; the event loop has a turn in any case."""
        await time_passes(self._left(count))

    def _left(self, count: int) -> float:
        return self._start + count / self._rate - time.perf_counter()
