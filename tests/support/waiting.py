"""Wait for conditions with a timeout, so that no test sleeps for a fixed time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from support.pausing import pass_time, time_passes

T = TypeVar("T")

LOOK_EVERY = 0.005
"""Seconds."""
REST = 2.0
"""Pause after a check as a multiple of its duration, as the awaited work needs the CPU too."""
LONGEST_REST = 0.1
"""Seconds, unless ``every`` is longer."""

PATIENCE = 90.0
"""Timeout for conditions that are certain to become true, even on a slow machine, seconds."""
STARTUP = 3 * PATIENCE
"""Timeout for the start of a program, whose imports alone need seconds of CPU, seconds."""


async def until(
    predicate: Callable[[], T | None],
    *,
    timeout: float = PATIENCE,  # noqa: ASYNC109 - the bound is the point
    what: str | Callable[[], str] = "the condition",
) -> T:
    """Return the first true value of ``predicate``; AssertionError after ``timeout`` s.

    ``what``: the condition, or a function that describes it at the timeout.
    """

    async def look() -> T | None:
        return predicate()

    found = await awaited(look, bool, seconds=timeout, what=what)
    assert found
    return found


async def awaited(
    look: Callable[[], Awaitable[T]],
    accept: Callable[[T], Any],
    *,
    seconds: float = PATIENCE,
    what: str | Callable[[], str],
    every: float = LOOK_EVERY,
) -> T:
    """Poll every ``every`` s, less often if a check takes long, until ``accept`` is true; return the result.

    Raises:
        AssertionError: no result was accepted within ``seconds``.
    """
    loop = asyncio.get_running_loop()
    began = loop.time()
    end = began + seconds
    while not accept(answer := await look()):
        now = loop.time()
        assert now < end, f"{_described(what)} did not come true in {seconds} s; last: {answer!r}"
        await time_passes(_pause(every, now - began))
        began = loop.time()
    return answer


def _described(what: str | Callable[[], str]) -> str:
    return what if isinstance(what, str) else what()


def _pause(every: float, spent: float) -> float:
    """Return the pause after a check that took ``spent`` seconds."""
    return max(every, min(REST * spent, LONGEST_REST))


def wait_until(
    condition: Callable[[], bool],
    *,
    timeout: float = PATIENCE,
    what: str = "the condition",
    every: float = LOOK_EVERY,
) -> None:
    """Block this thread until ``condition`` holds; AssertionError after ``timeout`` seconds."""
    began = time.monotonic()
    end = began + timeout
    while not condition():
        now = time.monotonic()
        assert now < end, f"{what} did not come true in {timeout} s"
        pass_time(_pause(every, now - began))
        began = time.monotonic()
