"""Resend a message until a state echoes it (section 6.1.2): growing pauses, a bounded number of times."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet.settings import FleetSettings


@dataclass(slots=True)
class Delivery:
    """Schedule for sending and resending a message, monotonic seconds; created when it can be sent."""

    settings: FleetSettings
    sendings: int = 0
    """Number of times it was sent since the robot was last unreachable."""
    in_all: int = 0
    """Number of times it was sent in total."""
    _due_at: float = 0.0
    _doubted_at: float | None = None
    """Time at which a refusal, perhaps of another message, was first seen, in monotonic seconds."""

    def due(self, now: float) -> bool:
        """Return whether the message is to be sent now."""
        return now >= self._due_at and self.sendings < self.settings.sendings

    def failed(self, now: float) -> bool:
        """Return whether the waiting time after the last sending has passed, too."""
        return now >= self._due_at and self.sendings >= self.settings.sendings

    def sent(self, now: float) -> None:
        """Note that the message was sent."""
        pause = self.settings.resend_after * 2.0**self.sendings
        self._due_at = now + min(pause, self.settings.resend_at_most_after)
        self.sendings += 1
        self.in_all += 1

    def is_refused(self, now: float, *, named: bool) -> bool:
        """Return whether a refusal counts; one that names nothing may be about another message.

        In that case the message is resent, and the robot gets its time to accept it.
        """
        if named or self.sendings >= self.settings.sendings:
            return True
        if self._doubted_at is None:
            self._doubted_at = now
            self._due_at = 0.0
        return now - self._doubted_at >= self.settings.resend_after

    def hold(self) -> None:
        """Restart the delivery when the message may be resent: the robot was unreachable."""
        self.sendings = 0
        self._due_at = 0.0
        self._doubted_at = None
