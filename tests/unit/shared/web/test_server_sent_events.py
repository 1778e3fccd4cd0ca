from __future__ import annotations

import asyncio

import httpx
from starlette.types import Message, Receive, Scope, Send

from nena_shared.web.server import HttpServer
from nena_shared.web.server_sent_events import LOOK_AFTER, EventRing, while_allowed
from nena_shared.web.settings import HttpSettings
from support.clocks import ManualClock
from support.pausing import turn_passes
from support.waiting import PATIENCE


async def test_an_event_wakes_all_clients() -> None:
    ring = EventRing[bytes](2)
    position = ring.count

    async def read() -> bytes:
        return b"".join(ring.last(ring.count - position) or ())

    clients = [ring.frames(read) for _ in range(3)]
    waiting = [asyncio.create_task(anext(each)) for each in clients]
    await turn_passes()

    ring.add(b"new")

    assert await asyncio.gather(*waiting) == [b"new"] * 3


async def test_event_during_a_read_is_not_missed() -> None:
    ring = EventRing[bytes](2)
    looks: list[int] = []

    async def read() -> bytes:
        looks.append(ring.count)
        if len(looks) == 1:
            ring.add(b"meanwhile")
            return b""
        return b"found"

    async with asyncio.timeout(PATIENCE):
        assert await anext(ring.frames(read)) == b"found"
    assert looks == [0, 1]


async def test_closing_ends_a_stream_and_wakes_its_client() -> None:
    ring = EventRing[bytes](2)

    async def read() -> bytes:
        return b""

    waiting = asyncio.create_task(anext(ring.frames(read), b"end"))
    await turn_passes()
    ring.close()

    assert await waiting == b"end"


def test_last_events_are_returned_while_stored() -> None:
    ring = EventRing[int](2)
    for each in range(3):
        ring.add(each)

    assert [ring.last(each) for each in range(4)] == [(), (2,), (1, 2), None]
    assert ring.count == 3


class Line:
    """What goes over the line of one request."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.welcome = True
        self.looks = 0
        self.sent: list[Message] = []
        self.send = while_allowed(self._send, self._allowed, self.clock)

    async def write(self, text: bytes) -> None:
        await self.send({"type": "http.response.body", "body": text, "more_body": True})

    @property
    def bodies(self) -> list[bytes]:
        return [message.get("body", b"") for message in self.sent]

    def _allowed(self) -> bool:
        self.looks += 1
        return self.welcome

    async def _send(self, message: Message) -> None:
        self.sent.append(message)


async def test_short_response_needs_no_check() -> None:
    line = Line()
    line.welcome = False

    await line.write(b"a")
    line.clock.advance(LOOK_AFTER / 2)
    await line.write(b"b")

    assert (line.bodies, line.looks) == ([b"a", b"b"], 0)


async def test_access_is_checked_at_most_once_a_second() -> None:
    line = Line()
    for _ in range(4):
        line.clock.advance(LOOK_AFTER / 2)
        await line.write(b"x")

    assert (line.bodies, line.looks) == ([b"x"] * 4, 2)


async def test_client_without_access_receives_nothing_more() -> None:
    line = Line()
    await line.write(b"a")
    line.welcome = False
    line.clock.advance(LOOK_AFTER)

    await line.write(b"b")
    await line.write(b"c")

    assert line.bodies == [b"a", b""]
    assert not line.sent[-1].get("more_body")


async def test_stream_without_access_is_told_that_its_client_has_gone() -> None:
    clock, welcome, told = ManualClock(), True, asyncio.Event()

    async def stream(_: Scope, receive: Receive, send: Send) -> None:
        nonlocal welcome
        send = while_allowed(send, lambda: welcome, clock)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await receive()
        welcome = False
        clock.advance(LOOK_AFTER)
        await send({"type": "http.response.body", "body": b"secret", "more_body": True})
        assert (await receive())["type"] == "http.disconnect"
        told.set()

    server = HttpServer(stream, HttpSettings(port=0))
    running = asyncio.create_task(server.run())
    try:
        async with httpx.AsyncClient(timeout=PATIENCE) as client:
            assert (await client.get(server.url)).text == ""
        await asyncio.wait_for(told.wait(), PATIENCE)
    finally:
        server.stop()
        await asyncio.wait_for(running, PATIENCE)
