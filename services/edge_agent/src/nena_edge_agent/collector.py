"""What Python's garbage collector need not look at."""

from __future__ import annotations

import gc
from functools import cache


@cache
def spare_what_is_loaded() -> None:
    """Exclude all objects loaded so far from garbage collection; a full pass would block a robot for 30 ms.

    Freezes once per process: a second freeze would keep what is left of a failed robot for good, and
    ``gc.get_freeze_count()`` walks all frozen objects.
    """
    gc.freeze()
