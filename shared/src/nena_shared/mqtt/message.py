"""Messages of an MQTT link."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Inbound:
    """A message that the broker delivered."""

    topic: str
    payload: bytes
    retained: bool
    """True when the broker had kept it from before the subscription."""
    qos: int = field(default=0, compare=False)
    """Its quality of service: the lower of the sender's and the subscription's."""


@dataclass(frozen=True, slots=True)
class Outbound:
    """A message to publish."""

    topic: str
    payload: bytes
    qos: int = 1
    retain: bool = False
    keep: bool = True
    """Whether it waits for the link and is resent after a break, or is sent only while the link is up."""
