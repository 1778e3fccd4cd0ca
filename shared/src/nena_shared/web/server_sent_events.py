"""Server-sent events: headers, heartbeats, wake-ups, and an end when the client loses its rights."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from starlette.types import Message, Receive, Send

from nena_shared.clock import Clock

HEADERS: Final[Mapping[str, str]] = MappingProxyType({"cache-control": "no-store", "x-accel-buffering": "no"})
"""Neither caches nor proxies may hold events back."""

HEARTBEAT: Final = 5.0
"""Seconds without an event after which a heartbeat is sent, so that both ends notice a dead line."""

HEARTBEAT_FRAME: Final = b"event: heartbeat\ndata: {}\n\n"


class News:
    """Wakes all at once who wait for something new, however many they are."""

    def __init__(self) -> None:
        self._next = asyncio.Event()

    @property
    def next(self) -> asyncio.Event:
        """Set once something newer comes; to be taken before one looks at what there is."""
        return self._next

    def came(self) -> None:
        """Wake all who wait; who takes :attr:`next` from now on waits for what comes after this."""
        self._next.set()
        self._next = asyncio.Event()


async def nothing_within(news: asyncio.Event, seconds: float) -> bool:
    """Wait for news; tell whether there was none for so long."""
    try:
        async with asyncio.timeout(seconds):
            await news.wait()
    except TimeoutError:
        return True
    return False


LOOK_AFTER = 1.0
"""Seconds after which the next part of an answer is held until it is known that it may be told."""

_END: Message = {"type": "http.response.body", "body": b"", "more_body": False}


class LastingAnswer:
    """Stands between an application and the server for one request.

    Each part of the answer that comes a second or more after the last look is sent only where ``allowed``
    says so; otherwise the answer ends before it, and the application is told that the client has gone.
    """

    def __init__(self, receive: Receive, send: Send, *, allowed: Callable[[], bool], clock: Clock) -> None:
        self._receive = receive
        self._send = send
        self._allowed = allowed
        self._clock = clock
        self._looked = clock.monotonic()
        self._over = asyncio.Event()

    async def send(self, message: Message) -> None:
        """Pass on a part of the answer, or end it; what comes after its end is nobody's."""
        if self._over.is_set():
            return
        now = self._clock.monotonic()
        if message["type"] == "http.response.body" and now - self._looked >= LOOK_AFTER:
            self._looked = now
            if not self._allowed():
                self._over.set()
                message = _END
        await self._send(message)

    async def receive(self) -> Message:
        """Return what comes from the client; after the end, that it has gone."""
        coming = asyncio.ensure_future(self._receive())
        over = asyncio.ensure_future(self._over.wait())
        try:
            await asyncio.wait((coming, over), return_when=asyncio.FIRST_COMPLETED)
            return {"type": "http.disconnect"} if self._over.is_set() else coming.result()
        finally:
            coming.cancel()
            over.cancel()
