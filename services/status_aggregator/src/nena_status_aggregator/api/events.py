"""The stream of changes that browsers and programs follow, as server-sent events.

Events are made once and shared by all clients. The last ones are kept in a ring; a client is nothing but a
place in it. That bounds what a client can cost, and gives the rule for slow ones: who is more than
``backlog`` events behind, or asks for an event that the ring has lost, or for one of an earlier run of this
program, gets a snapshot and goes on from there. No client can slow the others or the model.
"""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncGenerator, Callable
from http import HTTPStatus
from itertools import islice
from typing import Annotated

from fastapi import APIRouter, Header, Query
from starlette.responses import StreamingResponse

from nena_shared.web.event_source import HEADERS, HEARTBEAT, HEARTBEAT_FRAME, News, nothing_within
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.settings import EventSettings


class EventStream:
    """Ids are ``<epoch>-<number>``; the epoch is another one after each start of the program."""

    def __init__(
        self, settings: EventSettings, *, epoch: str, snapshot: Callable[[], tuple[int, bytes]]
    ) -> None:
        """Make an empty stream.

        Args:
            settings: the limits.
            epoch: names this run; neither blank nor ``-`` in it.
            snapshot: gives the number of the last event and, as JSON, everything up to it.

        """
        self._settings = settings
        self._epoch = epoch
        self._snapshot = snapshot
        self._ring: deque[bytes] = deque(maxlen=settings.history)
        self._last = 0
        self._news = News()
        self._closed = False
        self.clients = 0
        self.snapshots = 0

    @property
    def full(self) -> bool:
        """Whether there is no room for another client."""
        return self.clients >= self._settings.clients

    @property
    def events(self) -> int:
        """How many events there have been."""
        return self._last

    def publish(self, number: int, data: bytes) -> None:
        """Give an event to all clients; numbers rise by one."""
        self._ring.append(self._frame("delta", number, data))
        self._last = number
        self._news.came()

    def close(self) -> None:
        """End the streams of all clients."""
        self._closed = True
        self._news.came()

    async def follow(self, last_id: str | None) -> AsyncGenerator[bytes, None]:
        """Yield what a client gets that knows everything up to ``last_id``; None: that knows nothing.

        Nothing where there is no room: of those who ask at the same time each one may have seen the last.
        """
        if self.full:
            return
        self.clients += 1
        try:
            place = self._place_of(last_id)
            while not self._closed:
                news = self._news.next
                frames, place = self._next(place)
                if frames:
                    yield frames
                elif await nothing_within(news, HEARTBEAT):
                    yield HEARTBEAT_FRAME
        finally:
            self.clients -= 1

    def _next(self, place: int | None) -> tuple[bytes, int]:
        """Give all that a client at ``place`` has to get next, and where it is then."""
        behind = None if place is None else self._last - place
        if behind is None or behind > min(self._settings.backlog, len(self._ring)):
            number, data = self._snapshot()
            self.snapshots += 1
            return self._frame("snapshot", number, data), number
        return b"".join(islice(self._ring, len(self._ring) - behind, None)), self._last

    def _place_of(self, last_id: str | None) -> int | None:
        epoch, _, number = (last_id or "").partition("-")
        if epoch != self._epoch or not number.isdecimal() or int(number) > self._last:
            return None
        return int(number)

    def _frame(self, event: str, number: int, data: bytes) -> bytes:
        return b"id: %b-%d\nevent: %b\ndata: %b\n\n" % (self._epoch.encode(), number, event.encode(), data)


def make_router(stream: EventStream) -> APIRouter:
    """Make the route over ``stream``."""
    router = APIRouter(prefix="/api/v1", tags=["events"])

    @router.get("/events", response_class=StreamingResponse)
    async def events(
        last_event_id: Annotated[str | None, Header(description="Id of the last event received.")] = None,
        after: Annotated[
            str | None, Query(description="The same, for clients that cannot set headers.", max_length=100)
        ] = None,
    ) -> StreamingResponse:
        """Follow all changes as server-sent events.

        `snapshot` holds everything, `delta` what changed since the event before it, `heartbeat` nothing. A
        client that comes back with the id of its last event gets what it missed, or a snapshot if that is
        too much or too long ago.
        """
        if stream.full:
            detail = "Too many clients follow the events; raise --events.clients, or try again later."
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        return StreamingResponse(
            stream.follow(last_event_id or after), media_type="text/event-stream", headers=HEADERS
        )

    return router
