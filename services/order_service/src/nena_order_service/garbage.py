"""Keep full garbage collections short: with thousands of robots, they would hold the event loop."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any, Final

OLDEST: Final = 2
"""The generation of a full collection."""

GROWTH: Final = 100
"""Number of new robots whose objects are left out of full collections without having been searched once."""

LONG: Final = 0.05
"""Duration of a full collection from which on the objects that it has kept are left out of the next ones,
seconds."""


@contextmanager
def short_collections(robots: Callable[[], int]) -> Iterator[None]:
    """Leave old objects out of full collections, which then only search newer ones.

    Reference counting frees these objects, too, but not their cycles. Most belong to the plant model and to
    robots, and have none. Therefore this is only done when it matters: when many robots have come, and after
    a long collection. ``robots`` returns their number.
    """
    known = began = 0.0

    def on_collection(phase: str, info: dict[str, Any]) -> None:
        nonlocal known, began
        if info["generation"] != OLDEST:
            return
        if phase == "start":
            began = perf_counter()
            if (count := robots()) >= known + GROWTH:
                known = count
                gc.freeze()
        elif perf_counter() - began > LONG:
            gc.freeze()

    gc.callbacks.append(on_collection)
    try:
        yield
    finally:
        gc.callbacks.remove(on_collection)
