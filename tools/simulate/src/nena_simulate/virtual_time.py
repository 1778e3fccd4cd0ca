"""An event loop whose time jumps to the next timer as soon as nothing else is left to do."""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from concurrent.futures import Executor
from datetime import UTC, datetime, timedelta
from typing import Any, TypeVar, TypeVarTuple

from nena_shared.tasks import TaskFailedError, failure_listeners

T = TypeVar("T")
Ts = TypeVarTuple("Ts")

BEGINNING = datetime(2026, 1, 5, 6, 0, tzinfo=UTC)
"""Start time of every simulation: a Monday morning."""

TURN_SECONDS = 1e-6


class TimeStoodStillError(Exception):
    """The simulation waits for an event that cannot happen."""


class SimulationFailedError(Exception):
    """A program of the simulation has failed, although it would continue outside of it."""


class _Selector(selectors.SelectSelector):
    """Selector that advances the time instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Advance the time by ``timeout`` seconds; no event arrives from outside.

        Each turn of the loop takes some time, as on a real machine. Otherwise, code that sets a timer shorter
        than the clock's resolution would repeat it forever.
        """
        if timeout is None:
            message = "the simulation waits for an event that cannot happen"
            raise TimeStoodStillError(message)
        self.now += max(timeout, TURN_SECONDS)
        return []


class VirtualLoop(asyncio.SelectorEventLoop):
    """Runs unmodified asyncio code; timers fire in order, at their exact time, without waiting.

    There are no threads: executor jobs run immediately. So the same code with the same seed always runs in
    the same order.
    """

    def __init__(self) -> None:
        self._passing = _Selector()
        super().__init__(self._passing)

    def time(self) -> float:
        """Return the seconds since the start of the simulation."""
        return self._passing.now

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[*Ts], T], *args: *Ts
    ) -> asyncio.Future[T]:
        """Call ``func`` at once, in this thread."""
        del executor
        future: asyncio.Future[T] = self.create_future()
        try:
            future.set_result(func(*args))
        except Exception as error:  # noqa: BLE001 - it belongs to who awaits the future
            future.set_exception(error)
        return future


class VirtualClock:
    """The clock of all programs of a simulation."""

    def __init__(self, loop: VirtualLoop) -> None:
        self._loop = loop

    def monotonic(self) -> float:
        """Return the seconds since the start of the simulation."""
        return self._loop.time()

    def now(self) -> datetime:
        """Return the time of day, in UTC."""
        return BEGINNING + timedelta(seconds=self._loop.time())

    def cpu(self) -> float:
        """Return 0: work takes no time here, or a slow machine would change the result."""
        return 0.0


def run(work: Callable[[VirtualClock], Coroutine[Any, Any, T]]) -> T:
    """Run ``work`` to its end, however long that takes in simulated time.

    Raises:
        TimeStoodStillError: ``work`` waits for an event that cannot happen.
        SimulationFailedError: a task, a callback or a message handler has failed.
    """
    loop = VirtualLoop()
    asyncio.set_event_loop(loop)
    working = loop.create_task(work(VirtualClock(loop)))
    failures: list[tuple[str, BaseException]] = []

    def fail(event: str, error: BaseException) -> None:
        failures.append((event, error))
        working.cancel()

    def fail_callback(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        if error := context.get("exception"):
            fail(context["message"], error)

    loop.set_exception_handler(fail_callback)
    failure_listeners.append(fail)
    try:
        result = loop.run_until_complete(working)
    except asyncio.CancelledError:
        if not failures:
            raise
    except TaskFailedError as error:
        message = f"{error}: {error.__cause__!r}"
        raise SimulationFailedError(message) from error
    finally:
        failure_listeners.remove(fail)
        asyncio.set_event_loop(None)
        loop.close()
    for event, failure in failures:  # even if ``work`` has ended in spite of the cancellation
        message = f"{event}: {failure!r}"
        raise SimulationFailedError(message) from failure
    return result
