"""Supervised tasks: named, and never ending unnoticed."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Awaitable, Callable, Coroutine
from types import TracebackType
from typing import Any, Final, Self

from nena_shared.log import get_logger

log = get_logger(__name__)

AGAIN_AFTER = 5.0
"""Time for a task to end after its cancellation, before it is cancelled again, seconds."""


failure_listeners: Final[list[Callable[[str, BaseException], None]]] = []
"""Called with the description and the exception of each failure that a program survives. Nobody may notice it
in the log, so simulations and tests end with it."""


def report_failure(event: str, error: BaseException, **values: object) -> None:
    """Log a failure that the program survives, and tell :data:`failure_listeners`."""
    log.error(event, exc_info=error, **values)
    for listener in failure_listeners:
        listener(" ".join([event, *(f"{name}={value}" for name, value in values.items())]), error)


class StartError(Exception):
    """The program cannot start or go on; the message explains why and what to do."""


class TaskFailedError(Exception):
    """A vital task has ended."""

    def __init__(self, name: str) -> None:
        super().__init__(f"task '{name}' has ended")
        self.name = name


class Supervisor:
    """Runs the tasks of one program and ends them together.

    If a *vital* task ends or fails, the program ends: :meth:`wait` raises :class:`TaskFailedError`. Callers
    restart failed tasks with :func:`forever`, if required.
    """

    def __init__(self) -> None:
        self._tasks: set[asyncio.Task[None]] = set()
        self._failed: asyncio.Future[TaskFailedError] | None = None

    async def __aenter__(self) -> Self:
        """Allow tasks to be started."""
        self._failed = asyncio.get_running_loop().create_future()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Cancel the running tasks and wait until they have ended."""
        await end(*self._tasks)

    def start(self, name: str, work: Coroutine[Any, Any, None], *, vital: bool = True) -> asyncio.Task[None]:
        """Start ``work`` as a task."""
        task = asyncio.create_task(work, name=name)
        self._tasks.add(task)
        task.add_done_callback(lambda ended: self._task_ended(ended, vital=vital))
        return task

    def _task_ended(self, task: asyncio.Task[None], *, vital: bool) -> None:
        self._tasks.discard(task)
        if task.cancelled():
            return
        error = task.exception()
        if vital and isinstance(error, StartError):
            log.error("task failed", task=task.get_name(), reason=str(error))
        elif error is not None and vital:
            log.error("task failed", task=task.get_name(), exc_info=error)
        elif error is not None:
            report_failure("task failed", error, task=task.get_name())
        if vital and self._failed is not None and not self._failed.done():
            failure = TaskFailedError(task.get_name())
            failure.__cause__ = error
            # as a result: asyncio would log an exception that nobody awaits
            self._failed.set_result(failure)

    async def wait(self, stop: asyncio.Event) -> None:
        """Wait until ``stop`` is set.

        Raises:
            TaskFailedError: a vital task ended first; its exception is the cause.
        """
        failed = self._failed
        if failed is None:
            raise RuntimeError("enter the supervisor before waiting on it")
        stopping = asyncio.create_task(stop.wait(), name="wait for stop")
        both: set[asyncio.Future[Any]] = {stopping, failed}
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            stopping.cancel()
        if failed.done():
            raise failed.result()


async def end(*tasks: asyncio.Task[Any], again_after: float = AGAIN_AFTER) -> None:
    """Cancel tasks and wait until all have ended, regardless of their results.

    Tasks that have not ended after ``again_after`` seconds are cancelled again, because
    ``asyncio.wait_for`` of Python 3.11 loses a cancellation that arrives together with the awaited result.
    """
    left = set(tasks)
    while left:
        for task in left:
            task.cancel()
        _, left = await asyncio.wait(left, timeout=again_after)
        if left:
            log.warning("tasks did not end; cancelling them again", tasks=sorted(map(_name_of, left)))
    # retrieves their exceptions, which asyncio would log otherwise
    await asyncio.gather(*tasks, return_exceptions=True)


def _name_of(task: asyncio.Task[Any]) -> str:
    return task.get_name()


def end_if_cancelled() -> None:
    """End the current task if its cancellation was lost, see :func:`end`."""
    task = asyncio.current_task()
    if task is not None and task.cancelling():
        raise asyncio.CancelledError


async def set_within(event: asyncio.Event, seconds: float) -> bool:
    """Wait up to ``seconds`` for an event; return whether it is set."""
    try:
        async with asyncio.timeout(seconds):
            await event.wait()
    except TimeoutError:
        return False
    return True


async def forever(name: str, work: Callable[[], Awaitable[None]], *, pause: float = 1.0) -> None:
    """Repeat ``work`` forever; after a failure, log it and wait ``pause`` seconds."""
    while True:
        try:
            await work()
        except Exception as error:  # noqa: BLE001 - it is reported
            report_failure("task restarts after a failure", error, task=name, pause=pause)
            await asyncio.sleep(pause)


def stop_on_signals(stop: asyncio.Event) -> None:
    """Set ``stop`` on SIGINT and SIGTERM, so that the program shuts down gracefully."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
