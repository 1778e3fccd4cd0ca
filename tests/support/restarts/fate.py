"""When an agent dies: at the n-th of the moments at which it does something to the world."""

from __future__ import annotations

import asyncio


class Fate:
    """Counts the moments of one run of an agent; from the deadly one on nothing that it does has an effect.

    ``deadly`` is the number of that moment, from 1; None: it lives on.
    """

    def __init__(self, deadly: int | None = None) -> None:
        self._deadly = deadly
        self.moments: list[str] = []
        self.dead = asyncio.Event()

    @property
    def alive(self) -> bool:
        """Whether what the agent does has an effect."""
        return not self.dead.is_set()

    def spares(self, moment: str) -> bool:
        """Record a moment; return whether the agent still lives."""
        if self.alive:
            self.moments.append(moment)
            if len(self.moments) == self._deadly:
                self.dead.set()
        return self.alive
