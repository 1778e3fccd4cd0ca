"""The stream of changes, over a real store."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from typing import Any

import pytest

from nena_order_service.api.events import EventKind, EventStream, Interest
from nena_order_service.errors import StoreNotReadyError, TooManyClientsError
from nena_order_service.service import OrderService
from nena_order_service.settings import EventSettings
from nena_shared.fleet_api.transport_order import OrderSequenceRequest, TransportOrderRequest
from nena_shared.web import server_sent_events
from support.waiting import PATIENCE

ORDERS = Interest(frozenset({EventKind.TRANSPORT_ORDER}))


@dataclass(frozen=True)
class Told:
    event: str
    id: int | None
    data: Any


def parsed(frames: bytes) -> list[Told]:
    found = []
    for frame in frames.decode().split("\n\n")[:-1]:
        fields = dict(line.split(": ", 1) for line in frame.split("\n"))
        if "event" in fields:
            number = int(fields["id"]) if "id" in fields else None
            found.append(Told(fields["event"], number, json.loads(fields["data"])))
    return found


class Client:
    """Reads a stream frame by frame."""

    def __init__(self, frames: AsyncGenerator[bytes, None]) -> None:
        self._frames = frames

    async def hear(self) -> list[Told]:
        async with asyncio.timeout(PATIENCE):
            return parsed(await anext(self._frames))


def names(told: list[Told]) -> list[str]:
    return [each.data["name"] for each in told if each.event != "synced"]


def order(name: str, vehicle: str | None = None) -> TransportOrderRequest:
    body = {"name": name, "destinations": [{"locationName": "South 2"}], "intendedVehicle": vehicle}
    return TransportOrderRequest.model_validate(body)


@pytest.fixture(autouse=True)
def _dispatching_without_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let no slow decision delay the next one, after which an order would be published twice."""
    monkeypatch.setattr("nena_order_service.engine.engine.LONG_DECISION", math.inf)


@pytest.fixture
def stream(service: OrderService) -> EventStream:
    return service.stream


async def create(service: OrderService, *names: str) -> None:
    for name in names:
        service.engine.create(order(name), name)
    await service.engine.unit_of_work.committed()


async def withdraw(service: OrderService, name: str) -> None:
    found = service.engine.state.orders.named(name)
    assert found is not None
    service.engine.withdraw(found.number, "not needed")
    await service.engine.unit_of_work.committed()


async def test_a_new_client_receives_a_snapshot_and_then_changes(
    service: OrderService, stream: EventStream
) -> None:
    await create(service, "T-1", "T-2")
    await withdraw(service, "T-1")
    async with aclosing(stream.follow(None, Interest())) as frames:
        client = Client(frames)
        first = await client.hear()
        assert [(each.event, each.id) for each in first] == [
            ("transportOrder", None),
            ("vehicle", None),
            ("vehicle", None),
            ("synced", 3),
        ]
        assert names(first) == ["T-2", "Robot-01", "Robot-02"]
        await create(service, "T-3")
        (told,) = await client.hear()
        assert (told.event, told.id, told.data["name"]) == ("transportOrder", 4, "T-3")


async def test_a_reconnecting_client_receives_each_missed_order_once(
    service: OrderService, stream: EventStream
) -> None:
    await create(service, "T-1", "T-2", "T-3")
    await withdraw(service, "T-1")
    await withdraw(service, "T-3")
    async with aclosing(stream.follow("1", ORDERS)) as frames:
        client = Client(frames)
        missed = await client.hear()
        assert [(each.id, each.event) for each in missed] == [
            (2, "transportOrder"),
            (4, "transportOrder"),
            (5, "transportOrder"),
            (5, "synced"),
        ]
        assert names(missed) == ["T-2", "T-1", "T-3"]
        assert missed[1].data["state"] == "FAILED"
        await withdraw(service, "T-2")
        assert [each.id for each in await client.hear()] == [6]


async def test_ids_survive_a_restart(service: OrderService) -> None:
    await create(service, "T-1", "T-2")
    found = await service.store.read_unfinished()
    service.store.numbers.continue_after(found.last_change)
    restarted = EventStream(service.engine, EventSettings())
    async with aclosing(restarted.follow("1", ORDERS)) as frames:
        assert names(await Client(frames).hear()) == ["T-2"]


@pytest.mark.parametrize("last_id", ["99", "-1", "x", "1-2", "\u0663", "9" * 30])
async def test_an_unknown_event_id_is_a_gap(service: OrderService, stream: EventStream, last_id: str) -> None:
    await create(service, "T-1")
    async with aclosing(stream.follow(last_id, ORDERS)) as frames:
        told = await Client(frames).hear()
    assert [each.event for each in told] == ["gap", "transportOrder", "synced"]
    assert told[-1].id == 1


@pytest.mark.parametrize("last_id", [None, ""])
async def test_a_client_without_an_event_id_is_new(
    service: OrderService, stream: EventStream, last_id: str | None
) -> None:
    await create(service, "T-1")
    async with aclosing(stream.follow(last_id, ORDERS)) as frames:
        told = await Client(frames).hear()
    assert [each.event for each in told] == ["transportOrder", "synced"]


async def test_interests_filter_events(service: OrderService, stream: EventStream) -> None:
    await create(service, "T-1", "T-2")
    for interest, expected in (
        (Interest(transport_order="T-2"), ["T-2", "Robot-01", "Robot-02"]),
        (Interest(frozenset({EventKind.VEHICLE})), ["Robot-01", "Robot-02"]),
        (Interest(vehicle="Robot-01"), ["Robot-01"]),
        (Interest(frozenset({EventKind.TRANSPORT_ORDER}), vehicle="Robot-01"), []),
    ):
        async with aclosing(stream.follow(None, interest)) as frames:
            assert names(await Client(frames).hear()) == expected
        async with aclosing(stream.follow("0", interest)) as frames:
            assert names(await Client(frames).hear()) == expected


async def test_vehicles_are_published_with_their_current_status(
    service: OrderService, stream: EventStream
) -> None:
    async with aclosing(stream.follow(None, Interest(vehicle="Robot-02"))) as frames:
        client = Client(frames)
        await client.hear()
        with service.engine.change():
            service.engine.state.vehicle_changed("Robot-01")
            service.engine.state.vehicle_changed("Robot-02")
        assert [(each.event, each.id, each.data["name"]) for each in await client.hear()] == [
            ("vehicle", None, "Robot-02")
        ]


async def test_a_slow_client_receives_a_snapshot_and_does_not_slow_others(service: OrderService) -> None:
    stream = EventStream(service.engine, EventSettings(backlog=2))
    service.engine.unit_of_work.listeners[:] = [stream]
    service.engine.unit_of_work.vehicle_listeners[:] = [stream]
    async with aclosing(stream.follow(None, ORDERS)) as one, aclosing(stream.follow(None, ORDERS)) as other:
        slow, quick = Client(one), Client(other)
        await slow.hear()
        await quick.hear()
        await create(service, "T-1", "T-2")
        assert names(await quick.hear()) == ["T-1", "T-2"]
        await create(service, "T-3")
        assert names(await quick.hear()) == ["T-3"]
        behind = await slow.hear()
        assert [(each.event, each.id) for each in behind][-2:] == [("transportOrder", 3), ("synced", 3)]
        assert names(behind) == ["T-1", "T-2", "T-3"]
        await create(service, "T-4")
        assert names(await slow.hear()) == names(await quick.hear()) == ["T-4"]
    assert stream.overflows == 1


async def test_a_client_that_missed_too_much_gets_a_gap(service: OrderService) -> None:
    stream = EventStream(service.engine, EventSettings(replay_limit=2))
    await create(service, "T-1", "T-2", "T-3")
    await withdraw(service, "T-1")
    async with aclosing(stream.follow("0", ORDERS)) as frames:
        told = parsed(await anext(frames))
    assert [each.event for each in told] == ["gap", "transportOrder", "transportOrder", "synced"]
    assert told[-1].id == 4


async def test_heartbeats_are_sent_while_nothing_else_is(
    stream: EventStream, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server_sent_events, "HEARTBEAT", 0.01)
    async with aclosing(stream.follow(None, ORDERS)) as frames:
        client = Client(frames)
        await client.hear()
        assert [each.event for each in await client.hear()] == ["heartbeat"]


async def test_clients_are_limited_and_their_slots_are_released(service: OrderService) -> None:
    stream = EventStream(service.engine, EventSettings(clients=1))
    async with aclosing(stream.follow(None, ORDERS)) as frames:
        await anext(frames)
        with pytest.raises(TooManyClientsError, match="1 clients"):
            await anext(stream.follow(None, ORDERS))
    assert stream.clients == 0
    async with aclosing(stream.follow(None, ORDERS)) as frames:
        await anext(frames)


async def test_closing_ends_every_stream(stream: EventStream) -> None:
    async with aclosing(stream.follow(None, ORDERS)) as frames:
        await anext(frames)
        stream.close()
        assert await anext(frames, None) is None


async def test_unreadable_store_is_reported_first(
    service: OrderService, stream: EventStream, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail(*_: object) -> None:
        raise StoreNotReadyError("away")

    monkeypatch.setattr(service.store, "read_changes_after", fail)
    with pytest.raises(StoreNotReadyError):
        await anext(stream.follow("0", ORDERS))
    assert stream.clients == 0


async def test_order_sequence_events_are_opt_in(service: OrderService) -> None:
    stream = EventStream(service.engine, EventSettings())
    service.engine.unit_of_work.listeners[:] = [stream]
    service.engine.unit_of_work.vehicle_listeners[:] = [stream]
    with service.engine.change():
        service.engine.sequences.create(OrderSequenceRequest(), "S-1")
    await service.engine.unit_of_work.committed()
    interest = Interest(frozenset({EventKind.ORDER_SEQUENCE}))
    async with aclosing(stream.follow(None, interest)) as frames:
        client = Client(frames)
        told = await client.hear()
        assert [each.event for each in told] == ["orderSequence", "synced"]
        with service.engine.change():
            service.engine.sequences.create(OrderSequenceRequest(), "S-2")
        (told_now,) = await client.hear()
        assert (told_now.event, told_now.id, told_now.data["name"]) == ("orderSequence", None, "S-2")
    status = service.engine.state.sequences.visible("S-2")
    assert status
    for other in (ORDERS, Interest(transport_order="T-1"), Interest(vehicle="Robot-01")):
        assert not other.wants_sequence(status.status)
