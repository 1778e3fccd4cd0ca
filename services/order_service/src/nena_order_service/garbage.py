"""Keep full garbage collections short: with thousands of robots, they would hold the event loop."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import thread_time
from typing import Any, Final

OLDEST: Final = 2
"""The generation of a full collection."""

GROWTH: Final = 100
"""Number of new robots since the last but one full collection from which on their objects are left out,
without having been searched once. Factsheets and first states come after a robot is known."""

LONG: Final = 0.05
"""CPU time of a full collection from which on the objects that it has kept are left out of the next ones,
seconds; on a slow machine, about 50,000 objects."""


@contextmanager
def short_collections(robots: Callable[[], int]) -> Iterator[None]:
    """Leave old objects out of full collections, which then only search newer ones.

    Reference counting still frees these objects, but their cycles stay until the plant model changes: those
    of open requests and connections, and garbage since the last collection. Therefore this is only done when
    it matters: when many robots have come, and after a long collection. ``robots`` returns their number.
    """
    before = last = 0
    began = 0.0

    def on_collection(phase: str, info: dict[str, Any]) -> None:
        nonlocal before, last, began
        if info["generation"] != OLDEST:
            return
        if phase == "start":
            began = thread_time()
            if (now := robots()) >= before + GROWTH and gc.get_freeze_count():
                gc.freeze()  # not after a change of the plant model, which has just unfrozen the old one
            before, last = last, now
        elif thread_time() - began > LONG:
            gc.freeze()

    gc.callbacks.append(on_collection)
    try:
        yield
    finally:
        gc.callbacks.remove(on_collection)
