"""Resend a message with growing delays until a state echoes it, up to a maximum number of times."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet.settings import FleetSettings


@dataclass(slots=True)
class Delivery:
    """Schedule of a message's first sending and resends; times are in monotonic seconds."""

    settings: FleetSettings
    sendings: int = 0
    """Number of times that it was sent since the robot was last unreachable."""
    in_all: int = 0
    """Number of times that it was sent in total."""
    _due_at: float = 0.0
    _doubted_at: float | None = None
    """When a refusal that may be about another message was first seen."""

    def due(self, now: float) -> bool:
        """Return whether the message is to be sent now."""
        return now >= self._due_at and self.sendings < self.settings.sendings

    def failed(self, now: float) -> bool:
        """Return whether all attempts are used up and the delay after the last one has passed."""
        return now >= self._due_at and self.sendings >= self.settings.sendings

    def sent(self, now: float) -> None:
        """Note that the message was sent."""
        pause = self.settings.resend_after * 2.0**self.sendings
        self._due_at = now + min(pause, self.settings.resend_at_most_after)
        self.sendings += 1
        self.in_all += 1

    def is_refused(self, now: float, *, named: bool) -> bool:
        """Return whether a refusal counts: it is ``named``, or persists after a resend.

        An unnamed refusal may be about another message. The message is then resent first.
        """
        if named or self.sendings >= self.settings.sendings:
            return True
        if self._doubted_at is None:
            self._doubted_at = now
            self._due_at = 0.0
        return now - self._doubted_at >= self.settings.resend_after

    def hold(self) -> None:
        """Restart the schedule, because the robot cannot be sent the message now."""
        self.sendings = 0
        self._due_at = 0.0
        self._doubted_at = None
