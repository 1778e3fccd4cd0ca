"""Pauses before a program reconnects."""

from __future__ import annotations

from typing import Final

SUSPICIOUS: Final = 3
"""Connections in a row that ended right after they were made, after which something must be wrong."""


class Pauses:
    """Pauses that double, from ``shortest`` up to ``longest`` seconds.

    They start again at the shortest after a connection that lasted twice the longest pause. One that ended
    sooner counts as a failed attempt: two programs with one client ID disconnect each other at the broker,
    and would do so as fast as they can.
    """

    def __init__(self, shortest: float, longest: float) -> None:
        self._shortest, self._longest = shortest, longest
        self._next = shortest
        self._short_lived = 0

    @property
    def suspicious(self) -> bool:
        """Whether the last connection makes :data:`SUSPICIOUS` in a row that ended too soon."""
        return self._short_lived == SUSPICIOUS

    def after(self, stood: float | None) -> float:
        """Return the seconds to wait after a connection that lasted ``stood`` s; None if none was made."""
        if stood is not None and stood >= 2 * self._longest:
            self._next, self._short_lived = self._shortest, 0
        elif stood is not None:
            self._short_lived += 1
        pause, self._next = self._next, min(self._next * 2, self._longest)
        return pause
