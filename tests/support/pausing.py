"""Sleeps for tests of time itself: the only place at which tests sleep.

Expected events are awaited by their condition (``support.waiting``). Time only passes here if no condition
marks the end: a fault that lasts, a life cut short at some time, a span in which nothing may happen, the pace
of a load.
"""

from __future__ import annotations

import asyncio
import time


async def time_passes(seconds: float) -> None:
    """Sleep for so many seconds in the event loop.

    The duration itself is the fault, the load or the claim.
    """
    await asyncio.sleep(max(0.0, seconds))


async def turn_passes() -> None:
    """Let the event loop handle what is ready by now.

    Use it before asserting that something has *not* happened: what could have happened is ready, so waiting
    longer makes no difference. Also where a task has to get its turn among steps that do not wait.
    """
    await asyncio.sleep(0)


def pass_time(seconds: float) -> None:
    """Keep the calling thread, with the event loop in it, from all else for so many seconds; see above."""
    time.sleep(max(0.0, seconds))
