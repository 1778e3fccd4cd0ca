"""Server-sent events: a ring of events, heartbeats, and an end when a client loses its rights."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from types import MappingProxyType
from typing import Final, Generic, TypeVar

from starlette.types import Message, Receive, Send

from nena_shared.clock import Clock
from nena_shared.tasks import set_within

HEADERS: Final[Mapping[str, str]] = MappingProxyType({"cache-control": "no-store", "x-accel-buffering": "no"})
"""Neither caches nor proxies may hold events back."""

HEARTBEAT: Final = 5.0
"""Seconds without a frame after which a heartbeat is sent, so that both ends notice a dead line."""

HEARTBEAT_FRAME: Final = b"event: heartbeat\ndata: {}\n\n"


E = TypeVar("E")


class EventRing(Generic[E]):
    """The last events of a stream, kept once for all clients: a client is only a position among them.

    So a client costs no more than its connection, and none slows the others. A client that is further behind
    than the ring reaches has to be brought up to date from elsewhere.
    """

    def __init__(self, size: int) -> None:
        """Keep at most ``size`` events."""
        self.clients = 0
        self.count = 0
        """Events added so far."""
        self.closed = False
        self._ring: deque[E] = deque(maxlen=size)
        self._added = asyncio.Event()

    def add(self, event: E) -> None:
        """Add an event and wake all clients."""
        self._ring.append(event)
        self.count += 1
        self._wake()

    @property
    def kept(self) -> int:
        """Number of events that are kept."""
        return len(self._ring)

    def close(self) -> None:
        """End the streams of all clients."""
        self.closed = True
        self._wake()

    def last(self, number: int) -> tuple[E, ...] | None:
        """Return the last ``number`` events; None: fewer are kept."""
        if number > len(self._ring):
            return None
        return tuple(islice(self._ring, len(self._ring) - number, None))

    @contextmanager
    def client(self) -> Iterator[None]:
        """Count a client for as long as it follows the stream."""
        self.clients += 1
        try:
            yield
        finally:
            self.clients -= 1

    async def frames(self, read: Callable[[], Awaitable[bytes]]) -> AsyncGenerator[bytes, None]:
        """Yield what ``read`` returns, and again after each event, until the stream is closed.

        Events of which ``read`` returns nothing do not delay the heartbeat.
        """
        loop = asyncio.get_running_loop()
        due = loop.time() + HEARTBEAT
        while not self.closed:
            added = self._added
            if found := await read():
                yield found
            elif (left := due - loop.time()) > 0 and await set_within(added, left):
                continue
            else:
                yield HEARTBEAT_FRAME
            due = loop.time() + HEARTBEAT

    def _wake(self) -> None:
        self._added.set()
        self._added = asyncio.Event()


LOOK_AFTER = 1.0
"""Seconds after which the next part of an answer waits for a check of the client's rights."""

_END: Message = {"type": "http.response.body", "body": b"", "more_body": False}


class LastingAnswer:
    """Sits between an application and the server for one request.

    Each part of the answer that follows a second or more after the last check is sent only if ``allowed``
    returns True; otherwise the answer ends before it, and the application sees that the client has
    disconnected.
    """

    def __init__(self, receive: Receive, send: Send, *, allowed: Callable[[], bool], clock: Clock) -> None:
        self._receive = receive
        self._send = send
        self._allowed = allowed
        self._clock = clock
        self._looked = clock.monotonic()
        self._over = asyncio.Event()

    async def send(self, message: Message) -> None:
        """Pass on a part of the answer, or end it; later parts are dropped."""
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
        """Return what the client sends; after the end, its disconnection."""
        coming = asyncio.ensure_future(self._receive())
        over = asyncio.ensure_future(self._over.wait())
        try:
            await asyncio.wait((coming, over), return_when=asyncio.FIRST_COMPLETED)
            return {"type": "http.disconnect"} if self._over.is_set() else coming.result()
        finally:
            coming.cancel()
            over.cancel()
