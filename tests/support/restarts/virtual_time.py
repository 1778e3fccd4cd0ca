"""An event loop whose time passes only when nothing is left to do: an hour is soon over."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")
START = datetime(2026, 1, 1, tzinfo=UTC)
PATIENCE = 30.0
"""Real seconds."""


class _Selector(selectors.SelectSelector):
    """Waits only for other threads; all other waiting time is added to the clock."""

    seconds = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if not ready and timeout is None:  # at the end another thread shuts the executor down
            ready = super().select(PATIENCE)
            assert ready, "nothing will ever happen any more"
        elif not ready:
            self.seconds += max(0.0, timeout or 0.0)
        return ready


class _AtOnce(ThreadPoolExecutor):
    """Does what is for a thread at once."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:  # noqa: BLE001 - it is the caller's to look at
            future.set_exception(error)
        return future


class VirtualLoop(asyncio.SelectorEventLoop):
    """The loop; its time begins at 0."""

    def __init__(self) -> None:
        self._virtual = _Selector()
        super().__init__(self._virtual)
        self.set_default_executor(_AtOnce(max_workers=1))
        self.set_exception_handler(lambda _, context: self.failures.append(context))
        self.failures: list[dict[str, Any]] = []

    def time(self) -> float:
        """Seconds since the loop was made."""
        return self._virtual.seconds


class LoopClock:
    """The clock of the running loop."""

    def monotonic(self) -> float:
        """Seconds of the loop."""
        return asyncio.get_running_loop().time()

    def now(self) -> datetime:
        """Return a time of day that passes with the loop."""
        return START + timedelta(seconds=self.monotonic())

    def cpu(self) -> float:
        """Return 0: work takes no time."""
        return 0.0


def run_virtually(main: Coroutine[Any, Any, T]) -> T:
    """Run ``main`` in a separate loop; return its result."""
    loop = VirtualLoop()
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        try:
            return runner.run(main)
        finally:
            assert not loop.failures, loop.failures
