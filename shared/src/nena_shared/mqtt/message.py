"""Messages of an MQTT link."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Inbound:
    """A message that the broker delivered."""

    topic: str
    payload: bytes
    retained: bool
    """Whether the broker had retained it before the subscription."""
    qos: int = field(default=0, compare=False)
    """Quality of service: the lower of the sender's and the subscription's."""


@dataclass(frozen=True, slots=True)
class Outbound:
    """A message to publish."""

    topic: str
    payload: bytes
    qos: int = 1
    retain: bool = False
    keep: bool = True
    """Whether to queue it while the link is down and resend it after a disconnect."""
