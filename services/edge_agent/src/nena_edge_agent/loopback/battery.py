"""The battery of a loopback robot: driving takes charge, charging gives it back. Pure."""

from __future__ import annotations

from nena_edge_agent.loopback.settings import LoopbackSettings

FULL = 100.0
METRES_OF_DRAIN = 100.0


class Battery:
    """State of charge in percent; times are in s of a monotonic clock."""

    def __init__(self, settings: LoopbackSettings) -> None:
        self._drain = settings.drain / METRES_OF_DRAIN
        self._rate = settings.charge_rate
        self._charge = settings.charge
        self._charged_at: float | None = None

    @property
    def charging(self) -> bool:
        """Whether it is being charged."""
        return self._charged_at is not None

    def level(self, now: float) -> float:
        """Give the state of charge at the time ``now``."""
        if self._charged_at is not None:
            self._charge = min(FULL, self._charge + (now - self._charged_at) * self._rate)
            self._charged_at = now
        return self._charge

    def drive(self, metres: float) -> None:
        """Take what driving costs."""
        self._charge = max(0.0, self._charge - self._drain * metres)

    def switch(self, now: float, *, charging: bool) -> None:
        """Begin or end charging."""
        self.level(now)
        self._charged_at = now if charging else None

    def set_level(self, now: float, charge: float) -> None:
        """Hold ``charge`` percent from the time ``now`` on."""
        self.level(now)
        self._charge = charge
