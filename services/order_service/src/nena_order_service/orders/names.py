"""Names of orders for which nobody has given one."""

from __future__ import annotations

import time
from secrets import token_hex


def sortable_id() -> str:
    """Give an id that nothing else has; later ones sort behind earlier ones."""
    return f"{time.time_ns() // 1_000_000:012x}{token_hex(5)}"
