"""Time that passes because its passing is what is tried: the one place at which tests sleep.

What is sure to come is waited for by its condition (``support.waiting``). Time itself is let pass only
where no condition tells the end: a fault that lasts, a life that is cut short at some moment, a span in which
nothing may happen, the pace of a load. ``tests/unit/test_form.py`` sees to it that nobody else sleeps.
"""

from __future__ import annotations

import asyncio
import time


async def time_passes(seconds: float) -> None:
    """Let so many seconds of the event loop pass; their length is the fault, the load or the claim."""
    await asyncio.sleep(max(0.0, seconds))


async def turn_passes() -> None:
    """Let the event loop handle what is ready by now.

    Before it is asserted that something has *not* happened: what could have happened is ready, so there is
    nothing to wait for longer. Also where a task has to get its turn among steps that do not wait.
    """
    await asyncio.sleep(0)


def pass_time(seconds: float) -> None:
    """Keep the calling thread, with the event loop in it, from all else for so many seconds; see above."""
    time.sleep(max(0.0, seconds))
