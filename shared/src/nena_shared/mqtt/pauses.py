"""How long a program waits before it connects again."""

from __future__ import annotations

from typing import Final

SUSPICIOUS: Final = 3
"""Connections in a row that ended as soon as they stood, from which something is wrong with them."""


class Pauses:
    """Gives pauses that double, from ``shortest`` up to ``longest`` seconds.

    They begin anew behind a connection that has stood for twice the longest. One that ends sooner counts as a
    try that failed: two programs with one client id throw each other out at the broker, and would do so for
    ever as fast as they can.
    """

    def __init__(self, shortest: float, longest: float) -> None:
        self._shortest, self._longest = shortest, longest
        self._next = shortest
        self._short_lived = 0

    @property
    def suspicious(self) -> bool:
        """Whether, with the last connection, so many have ended too soon that a person should be told."""
        return self._short_lived == SUSPICIOUS

    def after(self, stood: float | None) -> float:
        """Give the seconds to wait after a connection that ``stood`` so many s, or none that came about."""
        if stood is not None and stood >= 2 * self._longest:
            self._next, self._short_lived = self._shortest, 0
        elif stood is not None:
            self._short_lived += 1
        pause, self._next = self._next, min(self._next * 2, self._longest)
        return pause
