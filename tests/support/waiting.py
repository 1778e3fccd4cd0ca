"""Waiting for a condition with a bound, so that no test sleeps for a fixed time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import TypeVar

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
    """Give the first true value of ``predicate``; AssertionError when there is none for ``timeout`` s."""
    loop = asyncio.get_running_loop()
    end = loop.time() + timeout
    while not (result := predicate()):
        assert loop.time() < end, f"{what} did not come true in {timeout} s; last seen: {result!r}"
        await asyncio.sleep(LOOK_EVERY)
    return result
