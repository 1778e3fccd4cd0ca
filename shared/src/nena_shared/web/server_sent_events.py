"""Server-sent events: ring buffer, heartbeats, and end of the stream when a client loses access."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import islice
from types import MappingProxyType
from typing import Final, Generic, TypeVar

from starlette.types import Message, Send

from nena_shared.clock import Clock
from nena_shared.tasks import set_within

HEADERS: Final[Mapping[str, str]] = MappingProxyType({"cache-control": "no-store", "x-accel-buffering": "no"})
"""Headers that keep caches and proxies from delaying events."""

HEARTBEAT: Final = 5.0
"""Idle time before a heartbeat, by which both ends detect a dead connection, seconds."""

# an event, not a comment: browsers do not pass comments on to scripts, which watch for silence
HEARTBEAT_FRAME: Final = b"event: heartbeat\ndata: {}\n\n"


E = TypeVar("E")


class EventRing(Generic[E]):
    """The last events of a stream, stored once for all clients; a client is a position in the ring.

    A client costs no more than its connection, and none slows down others. Clients that are further behind
    than the ring reaches need a snapshot from elsewhere.
    """

    def __init__(self, size: int) -> None:
        """Create an empty ring for ``size`` events."""
        self.clients = 0
        self.count = 0
        """Number of events added so far."""
        self.closed = False
        self._ring: deque[E] = deque(maxlen=size)
        self._added: asyncio.Event | None = None
        """Set when an event is added; None: no client waits for the next one."""

    def add(self, event: E) -> None:
        """Add an event and wake all clients."""
        self._ring.append(event)
        self.count += 1
        self._wake_readers()

    @property
    def kept(self) -> int:
        """Number of events in the ring."""
        return len(self._ring)

    def close(self) -> None:
        """End the streams of all clients."""
        self.closed = True
        self._wake_readers()

    def last(self, number: int) -> tuple[E, ...] | None:
        """Return the last ``number`` events; None if fewer are stored."""
        if number > len(self._ring):
            return None
        return tuple(islice(self._ring, len(self._ring) - number, None))

    @contextmanager
    def client(self) -> Iterator[None]:
        """Count a client for the duration of the block."""
        self.clients += 1
        try:
            yield
        finally:
            self.clients -= 1

    async def frames(self, read: Callable[[], Awaitable[bytes]]) -> AsyncGenerator[bytes, None]:
        """Yield the results of ``read``, called after each event, until the stream is closed.

        Events for which ``read`` returns nothing do not delay the heartbeat.
        """
        loop = asyncio.get_running_loop()
        due = loop.time() + HEARTBEAT
        while not self.closed:
            # before `read`, so that an event that is added during it is not missed
            added = self.added()
            if found := await read():
                yield found
            elif (left := due - loop.time()) > 0 and await set_within(added, left):
                continue
            else:
                yield HEARTBEAT_FRAME
            due = loop.time() + HEARTBEAT

    def added(self) -> asyncio.Event:
        """Return what is set when the next event is added, or the ring is closed."""
        if self._added is None:
            self._added = asyncio.Event()
        return self._added

    def _wake_readers(self) -> None:
        if self._added:
            self._added.set()
            self._added = None


LOOK_AFTER = 1.0
"""Interval between checks of a client's access during a response, seconds."""


def while_allowed(send: Send, allowed: Callable[[], bool], clock: Clock) -> Send:
    """Wrap ``send`` of a request, so that the response ends when its client loses access.

    A part that follows at least a second after the last check is sent only if ``allowed`` returns True.
    After the end the server tells the application that the client has disconnected, as ASGI defines it.
    """
    checked, ended = clock.monotonic(), False

    async def send_if_allowed(message: Message) -> None:
        nonlocal checked, ended
        if ended:
            return
        now = clock.monotonic()
        if message["type"] == "http.response.body" and now - checked >= LOOK_AFTER:
            checked, ended = now, not allowed()
        # an empty last part ends the response
        await send({"type": "http.response.body"} if ended else message)

    return send_if_allowed
