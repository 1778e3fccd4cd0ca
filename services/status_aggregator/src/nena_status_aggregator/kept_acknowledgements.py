"""Acknowledgements of what needs a person, retained at the broker, so that they outlast this program."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

from pydantic import TypeAdapter, ValidationError

from nena_shared.clock import Clock
from nena_shared.fleet_api.attention import Acknowledgement
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_status_aggregator.fleet.attention import AttentionRegistry

log = get_logger(__name__)

FOUND_WITHIN: Final = timedelta(minutes=3)
"""Time after a restart in which what was acknowledged is found again: robots are silent, queues are jams."""

_BY_MATTER: Final = TypeAdapter(dict[str, Acknowledgement])


class KeptAcknowledgements:
    """Keeps the acknowledgements of one aggregator under its own topic."""

    def __init__(self, mqtt: MqttLink, registry: AttentionRegistry, topic: str, clock: Clock) -> None:
        self._mqtt = mqtt
        self._registry = registry
        self._topic = topic
        self._clock = clock
        self._kept: dict[str, Acknowledgement] = {}
        self._restored = False
        mqtt.subscribe(topic, self._on_message, needed=False)

    def keep(self) -> None:
        """Retain the acknowledgements if they have changed; called periodically."""
        if self._registry.acknowledged == self._kept:
            return
        self._kept = {**self._registry.acknowledged}
        payload = _BY_MATTER.dump_json(self._kept, by_alias=True) if self._kept else b""
        self._mqtt.publish(Outbound(self._topic, payload, retain=True))

    def _on_message(self, inbound: Inbound) -> None:
        if self._restored or not inbound.retained or not inbound.payload:
            return
        self._restored = True
        try:
            found = _BY_MATTER.validate_json(inbound.payload)
        except ValidationError:
            log.warning("acknowledgements at the broker are unreadable", topic=inbound.topic)
            return
        self._kept = found
        self._registry.restore(found, self._clock.now() + FOUND_WITHIN)
