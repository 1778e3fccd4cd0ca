"""Waiting for a condition with a bound, so that no test sleeps for a fixed time."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

from support.pausing import pass_time, time_passes

T = TypeVar("T")

LOOK_EVERY = 0.005
"""Seconds."""

PATIENCE = 90.0
"""Seconds that a test waits for what is sure to come, on however slow a machine; no measure of speed."""


async def until(
    predicate: Callable[[], T | None],
    *,
    timeout: float = PATIENCE,  # noqa: ASYNC109 - the bound is the point
    what: str = "the condition",
) -> T:
    """Return the first true value of ``predicate``; AssertionError when there is none for ``timeout`` s."""

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
    what: str,
    every: float = LOOK_EVERY,
) -> T:
    """Poll every ``every`` s until ``accept`` is true for the answer, and return it.

    Raises:
        AssertionError: there was no such answer within ``seconds``.
    """
    loop = asyncio.get_running_loop()
    end = loop.time() + seconds
    while not accept(answer := await look()):
        assert loop.time() < end, f"{what} did not come true in {seconds} s; last: {answer!r}"
        await time_passes(every)
    return answer


def wait_until(
    condition: Callable[[], bool],
    *,
    timeout: float = PATIENCE,
    what: str = "the condition",
    every: float = LOOK_EVERY,
) -> None:
    """Keep this thread waiting until ``condition`` holds; AssertionError after ``timeout`` seconds."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"{what} did not come true in {timeout} s"
        pass_time(every)
