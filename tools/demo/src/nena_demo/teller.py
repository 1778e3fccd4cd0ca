"""What the demo prints: one line per thing that happens, with the seconds since the start."""

from __future__ import annotations

import time
from typing import TextIO


class Teller:
    """Prints lines with a time in front."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._start = time.monotonic()

    def say(self, text: str) -> None:
        """Print ``text`` with the seconds since the start."""
        self._out.write(f"[{time.monotonic() - self._start:7.2f} s] {text}\n")
        self._out.flush()

    def change(self, kind: str, name: str, state: str, reason: str) -> None:
        """Print the new state of an order or a vehicle."""
        self.say(f"{kind:7} {name:22} {state:18} {reason}")
