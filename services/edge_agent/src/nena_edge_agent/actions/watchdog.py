"""Sees what keeps an event loop from running: looks from another thread, and says where it stands."""

from __future__ import annotations

import asyncio
import sys
import threading
import traceback
from pathlib import Path
from typing import Final

LOOK_EVERY: Final = 0.05
"""Seconds between two looks."""
LOOKS: Final = 4
"""Looks at a loop that does not come round, until it counts as blocked. Looks and not seconds: on a machine
that is busy they are late as well."""
LONGEST: Final = 100
"""Looks, until a loop counts as one that will never come round."""
WAITING: Final = frozenset({"select", "poll", "epoll", "_run_once"})
"""Functions in which a loop waits, or is between two steps."""


class Watchdog:
    """Watches the loop in whose thread it is begun; ``blocked`` is where that stood still, empty: nowhere."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        self._rounds = 0
        self._stop = threading.Event()
        self.blocked = ""
        self.hangs = threading.Event()
        """Set when the loop will not come round any more."""
        self._beat()
        threading.Thread(target=self._watch, name="watchdog", daemon=True).start()

    def stop(self) -> None:
        """Look no more."""
        self._stop.set()

    def _beat(self) -> None:
        self._rounds += 1
        self._loop.call_later(LOOK_EVERY / 2, self._beat)

    def _watch(self) -> None:
        seen, looks = 0, 0
        while not self._stop.wait(LOOK_EVERY):
            stuck = self._rounds == seen and not self._idle()
            looks, seen = (looks + 1 if stuck else 0), self._rounds
            if looks == LOOKS:
                self.blocked = self.blocked or self._place()
            if looks == LONGEST:
                self.hangs.set()

    def _idle(self) -> bool:
        frame = sys._current_frames().get(self._thread)  # noqa: SLF001 - the documented way to see another thread
        return frame is None or frame.f_code.co_name in WAITING

    def _place(self) -> str:
        """Give the last line of the stack that is neither the loop's nor the library's."""
        frame = sys._current_frames().get(self._thread)  # noqa: SLF001
        stack = traceback.extract_stack(frame) if frame else []
        library = str(Path(threading.__file__).parent)
        own = [
            each
            for each in stack
            if not each.filename.startswith(library) or "site-packages" in each.filename
        ]
        last = (own or stack)[-1] if stack else None
        return f"{last.filename}:{last.lineno} in {last.name}" if last else "an unknown place"
