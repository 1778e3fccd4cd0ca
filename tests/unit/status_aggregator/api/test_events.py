from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator
from contextlib import aclosing

import pytest

from nena_shared.tasks import end
from nena_shared.web import server_sent_events
from nena_status_aggregator.api.events import EventStream
from nena_status_aggregator.settings import EventSettings
from support.pausing import time_passes
from support.waiting import PATIENCE

Events = list[tuple[str, str]]


class Published:
    """Publishes numbered deltas and has the matching snapshot."""

    def __init__(self, **settings: int) -> None:
        self.number = 0
        self.stream = EventStream(EventSettings(**settings), epoch="e", snapshot=self.snapshot)

    def snapshot(self) -> tuple[int, bytes]:
        return self.number, json.dumps({"upTo": self.number}).encode()

    def publish(self, count: int = 1) -> None:
        for _ in range(count):
            self.number += 1
            self.stream.publish(self.number, b"{}")


def parsed(frames: bytes) -> Events:
    events = []
    for frame in frames.decode().split("\n\n")[:-1]:
        fields = dict(line.split(": ", 1) for line in frame.split("\n"))
        events.append((fields["event"], fields.get("id", "")))
    return events


def follower(published: Published, last_id: str | None = None) -> aclosing[AsyncGenerator[bytes, None]]:
    return aclosing(published.stream.follow(last_id))


async def test_new_client_receives_a_snapshot_then_changes() -> None:
    published = Published()
    published.publish(2)
    async with follower(published) as frames:
        assert parsed(await anext(frames)) == [("snapshot", "e-2")]
        published.publish(2)
        assert parsed(await anext(frames)) == [("delta", "e-3"), ("delta", "e-4")]


async def test_reconnecting_client_receives_missed_events() -> None:
    published = Published()
    published.publish(5)
    async with follower(published, "e-3") as frames:
        assert parsed(await anext(frames)) == [("delta", "e-4"), ("delta", "e-5")]
    assert published.stream.snapshots == 0


@pytest.mark.parametrize("last_id", ["other-3", "e-99", "e-", "e--1", "nonsense", "e-x"])
async def test_unknown_event_id_yields_a_snapshot(last_id: str) -> None:
    published = Published()
    published.publish(5)
    async with follower(published, last_id) as frames:
        assert parsed(await anext(frames)) == [("snapshot", "e-5")]


async def test_events_no_longer_in_the_ring_are_replaced_by_a_snapshot() -> None:
    published = Published(history=3)
    published.publish(5)
    async with follower(published, "e-1") as frames:
        assert parsed(await anext(frames)) == [("snapshot", "e-5")]
    async with follower(published, "e-2") as frames:
        assert [number for _, number in parsed(await anext(frames))] == ["e-3", "e-4", "e-5"]


async def test_client_that_falls_behind_receives_a_snapshot() -> None:
    published = Published(backlog=3)
    async with follower(published) as slow, follower(published) as quick:
        assert parsed(await anext(slow)) == parsed(await anext(quick)) == [("snapshot", "e-0")]
        published.publish(2)
        assert len(parsed(await anext(quick))) == 2
        published.publish(2)
        assert len(parsed(await anext(quick))) == 2
        assert parsed(await anext(slow)) == [("snapshot", "e-4")]
        published.publish()
        assert parsed(await anext(slow)) == [("delta", "e-5")]


async def test_heartbeats_are_sent_while_idle(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_sent_events, "HEARTBEAT", 0.01)
    published = Published()
    async with follower(published) as frames:
        await anext(frames)
        assert parsed(await anext(frames)) == [("heartbeat", "")]


async def test_events_that_a_client_does_not_get_do_not_delay_its_heartbeat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server_sent_events, "HEARTBEAT", 0.05)
    ring = server_sent_events.EventRing[int](10)

    async def nothing() -> bytes:
        return b""

    async def busy() -> None:
        while True:
            ring.add(0)
            await time_passes(0.01)

    adding = asyncio.create_task(busy())
    async with aclosing(ring.frames(nothing)) as frames, asyncio.timeout(PATIENCE):
        assert await anext(frames) == server_sent_events.HEARTBEAT_FRAME
    await end(adding)


async def test_clients_are_counted_and_limited() -> None:
    published = Published(clients=1)
    fullness = [published.stream.full]
    async with follower(published) as frames:
        await anext(frames)
        fullness.append(published.stream.full)
    fullness.append(published.stream.full)
    assert fullness == [False, True, False]


async def test_concurrent_clients_respect_the_limit() -> None:
    published = Published(clients=2)
    followers = [published.stream.follow(None) for _ in range(4)]  # all of them have seen that there is room
    begun = [await anext(frames, b"") for frames in followers]
    assert ([bool(each) for each in begun], published.stream.clients) == ([True, True, False, False], 2)
    for frames in followers:
        await frames.aclose()
    assert published.stream.clients == 0


async def test_closing_ends_every_stream() -> None:
    published = Published()
    async with follower(published) as frames:
        await anext(frames)
        published.stream.close()
        assert await anext(frames, None) is None
