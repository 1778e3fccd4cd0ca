"""What Python's garbage collector need not look at."""

from __future__ import annotations

import gc


def spare_what_is_loaded() -> None:
    """Have the collector leave alone what is there by now; to look at it all would hold a robot up for 30 ms.

    Once for a process, else what is left of a robot that has failed would stay for good.
    """
    if not gc.get_freeze_count():
        gc.freeze()
