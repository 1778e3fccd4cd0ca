"""When states are due: on request, but not too often, and not too seldom (section 6.6)."""

from __future__ import annotations

from math import inf


class StateSchedule:
    """Times in s of a monotonic clock; requests that come too fast are answered by one state."""

    def __init__(self, *, minimum: float, maximum: float) -> None:
        self._minimum = minimum
        self._maximum = maximum
        self._last = -inf
        self._requested = inf

    def request(self, now: float) -> None:
        """Want a state as soon as the minimum interval allows."""
        self._requested = min(self._requested, now)

    @property
    def due(self) -> float:
        """When the next state is to be sent."""
        return min(max(self._requested, self._last + self._minimum), self._last + self._maximum)

    def sent(self, now: float) -> None:
        """Note that a state was sent."""
        self._last, self._requested = now, inf


class VisualizationSchedule:
    """An even rate; an interval of 0 means never."""

    def __init__(self, *, interval: float, now: float) -> None:
        self._interval = interval
        self._next = now if interval else inf

    @property
    def due(self) -> float:
        """When the next visualization message is to be sent."""
        return self._next

    def sent(self, now: float) -> None:
        """Note that one was sent; what was missed is not made up for."""
        self._next = max(self._next + self._interval, now)
