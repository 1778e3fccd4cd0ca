from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import Any
from unittest.mock import AsyncMock, Mock

import pytest

from nena_order_service.api import statuses as ended_orders
from nena_order_service.api.statuses import EndedOrders, RetainedSweep
from nena_order_service.errors import StoreNotReadyError
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.mqtt.link import LinkState
from nena_shared.settings import MqttSettings
from support.forgetful import cancel_again_at_once, forgetful
from support.pausing import turn_passes
from support.waiting import PATIENCE, until

LONG = 3600.0


def ended(name: str, version: int = 1) -> TransportOrderStatus:
    return TransportOrderStatus(
        name=name,
        version=version,
        state=TransportOrderState.FINISHED,
        reason="done",
        type="-",
        priority=0,
        current_drive_order_index=1,
        created=datetime(2026, 1, 1, tzinfo=UTC),
        drive_orders=(),
    )


async def test_an_ended_order_stays_retained_for_a_time_and_is_then_cleared() -> None:
    cleared: list[str] = []
    ends = EndedOrders(0.05, cleared.append)
    ends.add(ended("T-1"))

    assert (ends.statuses(), cleared) == ((ended("T-1"),), [])
    await until(lambda: cleared == ["T-1"])
    assert ends.statuses() == ()


async def test_a_republished_end_is_cleared_once() -> None:
    cleared: list[str] = []
    ends = EndedOrders(0.05, cleared.append)
    ends.add(ended("T-1"))
    ends.add(ended("T-1", version=2))
    ends.add(ended("T-2"))

    assert ends.statuses() == (ended("T-1", version=2), ended("T-2"))
    await until(lambda: "T-2" in cleared)
    assert cleared == ["T-1", "T-2"]


async def test_the_oldest_retained_end_is_cleared_beyond_the_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ended_orders, "ENDS_KEPT", 2)
    cleared: list[str] = []
    ends = EndedOrders(LONG, cleared.append)
    for name in ("T-1", "T-2", "T-3"):
        ends.add(ended(name))

    assert cleared == ["T-1"]
    assert [each.name for each in ends.statuses()] == ["T-2", "T-3"]
    ends.close()


async def test_one_timer_clears_the_statuses_of_many_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    ends, timers = EndedOrders(LONG, lambda _: None), list[float]()
    loop = asyncio.get_running_loop()
    call_at = loop.call_at

    def counted(when: float, callback: Any, *args: Any) -> asyncio.TimerHandle:
        timers.append(when)
        return call_at(when, callback, *args)

    monkeypatch.setattr(loop, "call_at", counted)
    for number in range(100):
        ends.add(ended(f"T-{number}"))
    ends.close()

    assert len(timers) == 1


async def test_after_the_close_nothing_is_cleared() -> None:
    cleared: list[str] = []
    closed, other = EndedOrders(0.01, cleared.append), EndedOrders(0.05, cleared.append)
    closed.add(ended("T-1"))
    closed.close()
    other.add(ended("T-2"))

    await until(lambda: cleared != [])
    await turn_passes()
    assert (cleared, closed.statuses()) == (["T-2"], ())


async def test_it_ends_even_if_its_link_swallows_the_cancellation(monkeypatch: pytest.MonkeyPatch) -> None:
    cancel_again_at_once(monkeypatch)
    monkeypatch.setattr(MqttLink, "run", forgetful)
    sweep = RetainedSweep(
        MqttSettings(), client_id="sweep", engine=Mock(), publisher=Mock(topics=FleetTopics())
    )
    running = asyncio.create_task(sweep.run(), name="sweep")
    await turn_passes()
    await turn_passes()
    running.cancel()
    await asyncio.wait({running}, timeout=PATIENCE)
    assert running.cancelled()


async def test_sweep_is_repeated_after_the_database_was_unavailable(monkeypatch: pytest.MonkeyPatch) -> None:
    topics = FleetTopics()
    left = Inbound(topics.order_status("T-1"), b"{}", retained=True)

    async def deliver(link: MqttLink) -> None:
        link._hooks.on_connected()
        for handler in link._handlers(left.topic):
            handler(left)

    monkeypatch.setattr(MqttLink, "run", deliver)
    monkeypatch.setattr(ended_orders, "LISTEN", 0.0)
    monkeypatch.setattr(ended_orders, "STORE_RETRY", 0.0)
    engine, publisher = Mock(), Mock(topics=topics, epoch=5)
    publisher.mqtt.state = LinkState(connected=True, term=1)
    engine.state.orders.visible_named.return_value = None
    engine.store.read_order = AsyncMock(
        side_effect=[StoreNotReadyError("server closed the connection"), None]
    )
    sweep = RetainedSweep(MqttSettings(), client_id="sweep", engine=engine, publisher=publisher)
    running = asyncio.create_task(sweep.run(), name="sweep")

    await until(lambda: publisher.mqtt.publish.called or running.done())

    publisher.mqtt.publish.assert_called_once_with(Outbound(left.topic, b"", retain=True))
    assert not running.done(), "the next term is swept, too"
    running.cancel()
    await asyncio.wait({running}, timeout=PATIENCE)
