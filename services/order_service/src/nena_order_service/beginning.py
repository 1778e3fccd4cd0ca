"""The beginning of an order service: it takes up its orders, and waits while the store takes nothing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from nena_shared.tasks import Supervisor, end

LOOK = 0.25
"""Seconds between looks at whether the store takes what the beginning writes."""


async def has_begun(
    begin: Coroutine[Any, Any, None],
    supervisor: Supervisor,
    stop: asyncio.Event,
    *,
    waits: Callable[[], bool],
    tell: Callable[[], None],
) -> bool:
    """Let ``begin`` come to its end; False: the program is to stop before.

    Once ``waits`` says that the store takes nothing, ``tell`` is called, so that somebody is told why nothing
    happens: the beginning goes on by itself as soon as the store takes changes again.

    Raises:
        TaskFailedError: a part that the rest cannot do without has failed meanwhile.

    """
    beginning = asyncio.create_task(begin, name="begin")
    ending = asyncio.create_task(supervisor.wait(stop), name="wait for the end")
    told = False
    try:
        while not beginning.done() and not ending.done():
            await asyncio.wait((beginning, ending), timeout=LOOK, return_when=asyncio.FIRST_COMPLETED)
            if not told and waits():
                told = True
                tell()
    finally:
        await end(beginning, ending)
    if beginning.cancelled():
        ending.result()
        return False
    beginning.result()
    return True
