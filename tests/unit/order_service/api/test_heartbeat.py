from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from nena_order_service.api import statuses
from nena_order_service.api.statuses import Heartbeat
from nena_shared.fleet_api.epoch import epoch_of
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Outbound
from nena_shared.mqtt.link import LinkState
from nena_shared.tasks import end
from support.clocks import ManualClock
from support.pausing import time_passes
from support.waiting import until


class Link:
    """Keeps what is published."""

    def __init__(self, *, connected: bool) -> None:
        self.state = LinkState(connected=connected)
        self.published: list[Outbound] = []

    def publish(self, message: Outbound) -> None:
        self.published.append(message)

    @property
    def online(self) -> list[bool]:
        return [ServiceStatus.model_validate_json(each.payload).online for each in self.published]


@pytest.fixture
def beating(monkeypatch: pytest.MonkeyPatch) -> Callable[[], Heartbeat]:
    monkeypatch.setattr(statuses, "HEARTBEAT", 0.001)
    return lambda: Heartbeat(FleetTopics(), ManualClock(), epoch=7, store_ready=lambda: True)


async def test_heartbeats_are_retained_with_their_epoch_and_end_in_order(
    beating: Callable[[], Heartbeat],
) -> None:
    heart, link = beating(), Link(connected=True)
    mqtt: Any = link
    running = asyncio.create_task(heart.run(mqtt))
    await until(lambda: len(link.published) > 3)
    heart.end(mqtt)
    count = len(link.published)
    for _ in range(5):
        await time_passes(0.002)  # longer than a beat: none may follow the end
    await end(running)

    assert link.online == [True] * (count - 1) + [False]
    assert {each.topic for each in link.published} == {"nena/v1/orderService/status"}
    assert all(each.retain for each in link.published)
    assert epoch_of(link.published[0].payload) == 7
    assert ServiceStatus.model_validate_json(link.published[0].payload).store_ready


async def test_without_the_broker_nothing_is_published_or_counted_as_dropped(
    beating: Callable[[], Heartbeat],
) -> None:
    link = Link(connected=False)
    mqtt: Any = link
    running = asyncio.create_task(beating().run(mqtt))
    for _ in range(5):
        await time_passes(0.002)
    link.state.connected = True
    await until(lambda: bool(link.published))
    await end(running)

    assert link.online[0] is True


def test_the_last_will_reports_offline(beating: Callable[[], Heartbeat]) -> None:
    will = beating().will()
    said = ServiceStatus.model_validate_json(will.payload)
    assert (said.online, said.store_ready, will.retain) == (False, False, True)
