"""Acknowledgements that outlast the aggregator, over a link that only notes what is published."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import pytest

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.kept_acknowledgements import FOUND_WITHIN, KeptAcknowledgements
from support.clocks import ManualClock
from support.fleet_examples import START
from support.matters import ModelSite, emergency

TOPIC = FleetTopics().acknowledgements("1/2")


class Link:
    """Notes what is published."""

    def __init__(self) -> None:
        self.published: list[Outbound] = []
        self.handler: Callable[[Inbound], None] = lambda _: None

    def subscribe(self, _topic: str, handler: Callable[[Inbound], None], **_: Any) -> None:
        self.handler = handler

    def publish(self, message: Outbound) -> None:
        self.published.append(message)


class Run:
    """An aggregator with a robot at an emergency stop, from its start; ``retained`` is at the broker."""

    def __init__(self, retained: bytes = b"") -> None:
        self.site = ModelSite(FleetModel(ModelLimits(silence=3600)), ManualClock(start=START))
        self.link = Link()
        registry = self.site.model.attention
        self.kept = KeptAcknowledgements(cast("MqttLink", self.link), registry, TOPIC, self.site.clock)
        if retained:
            self.link.handler(Inbound(TOPIC, retained, retained=True))
        self.site.robot("Hit", **emergency("MANUAL"))
        self.site.wait(1)
        self.kept.keep()

    def acknowledge(self) -> None:
        self.site.model.attention.acknowledge("emergency_stop:Hit", "Anna", self.site.now)
        self.kept.keep()

    @property
    def retained(self) -> list[bytes]:
        assert all(each.topic == TOPIC and each.retain for each in self.link.published)
        return [each.payload for each in self.link.published]

    @property
    def names(self) -> list[str | None]:
        return [each.acknowledged.by if each.acknowledged else None for each in self.site.list()]


def test_acknowledgement_survives_a_restart_and_goes_with_its_matter() -> None:
    first = Run()
    assert (first.retained, first.names) == ([], [None])
    first.acknowledge()
    (kept,) = first.retained
    second = Run(kept)
    assert (second.retained, second.names) == ([], ["Anna"])
    second.site.robot("Hit")
    second.site.wait(1)
    second.kept.keep()
    assert second.retained == [b""]


def test_what_ended_while_nothing_ran_is_dropped() -> None:
    first = Run()
    first.acknowledge()
    second = Run(first.retained[0].replace(b"Hit", b"Other"))
    second.site.wait(int(FOUND_WITHIN.total_seconds()))
    second.kept.keep()
    assert second.retained == [b""]


@pytest.mark.parametrize("payload", [b"?", b"[]", b'{"jam:X": {"by": 7}}'])
def test_what_is_unreadable_is_passed_over(payload: bytes) -> None:
    run = Run(payload)
    run.acknowledge()
    assert run.names == ["Anna"]
