"""Large models are built while Python's cyclic garbage collector rests."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def paused_collector() -> Iterator[None]:
    """Keep the collector from running.

    A model is made of some hundred thousand objects that all stay and have no cycles; the collector would go
    through them again and again, which takes a third of the time of loading a large plant.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
