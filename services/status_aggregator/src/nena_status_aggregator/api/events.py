"""The event stream ``/api/v1/events`` (server-sent events)."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Callable
from typing import Annotated

from fastapi import APIRouter, Header, Query
from starlette.responses import StreamingResponse

from nena_shared.fleet_api.refusals import Refusal
from nena_shared.web.server_sent_events import HEADERS, EventRing
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.settings import EventSettings


class EventStream(EventRing[bytes]):
    """Encodes each event once for all clients.

    A client that is more than ``backlog`` events behind, or resumes after an event that is no longer kept,
    receives a snapshot. IDs are ``<epoch>-<number>``; the epoch changes with each start of the program.
    """

    def __init__(
        self, settings: EventSettings, *, epoch: str, snapshot: Callable[[], tuple[int, bytes]]
    ) -> None:
        """Create an empty stream.

        Args:
            settings: the limits.
            epoch: identifies this run; without spaces and ``-``.
            snapshot: returns the number of the last event, and the fleet as of it as JSON.
        """
        super().__init__(settings.history)
        self._settings = settings
        self._epoch = epoch
        self._snapshot = snapshot
        self._last = 0
        self.snapshots = 0

    @property
    def full(self) -> bool:
        """Whether the client limit is reached."""
        return self.clients >= self._settings.clients

    @property
    def events(self) -> int:
        """Number of events published."""
        return self._last

    def publish(self, number: int, data: bytes) -> None:
        """Publish an event to all clients; numbers increase by one."""
        self._last = number
        self.add(self._make_frame("delta", number, data))

    async def follow(self, last_id: str | None) -> AsyncGenerator[bytes, None]:
        """Yield the events after ``last_id``; None: start with a snapshot.

        Yields nothing if the client limit has been reached since :attr:`full` was checked.
        """
        if self.full:
            return
        position = self._position_of(last_id)

        async def following() -> bytes:
            nonlocal position
            frames, position = self._next_frames(position)
            return frames

        with self.client():
            async for frames in self.frames(following):
                yield frames

    def _next_frames(self, position: int | None) -> tuple[bytes, int]:
        """Return the next frames for a client at ``position``, and its new position."""
        behind = None if position is None else self._last - position
        events = self.last(behind) if behind is not None and behind <= self._settings.backlog else None
        if events is None:
            number, data = self._snapshot()
            self.snapshots += 1
            return self._make_frame("snapshot", number, data), number
        return b"".join(events), self._last

    def _position_of(self, last_id: str | None) -> int | None:
        epoch, _, number = (last_id or "").partition("-")
        if epoch != self._epoch or not number.isdecimal() or int(number) > self._last:
            return None
        return int(number)

    def _make_frame(self, event: str, number: int, data: bytes) -> bytes:
        return b"id: %b-%d\nevent: %b\ndata: %b\n\n" % (self._epoch.encode(), number, event.encode(), data)


def make_router(stream: EventStream) -> APIRouter:
    """Create the route of the event stream."""
    router = APIRouter(prefix="/api/v1", tags=["events"])

    @router.get("/events", response_class=StreamingResponse)
    async def events(
        last_event_id: Annotated[str | None, Header(description="ID of the last event received.")] = None,
        after: Annotated[
            str | None,
            Query(description="Same as Last-Event-ID, for clients that cannot set headers.", max_length=100),
        ] = None,
    ) -> StreamingResponse:
        """Stream all changes as server-sent events.

        `snapshot` contains everything, `delta` the changes since the previous event, `heartbeat` nothing. A
        client that resumes with the ID of its last event receives the events it missed, or a snapshot if
        they are no longer available.
        """
        if stream.full:
            detail = "Too many event stream clients. Increase --events.clients or try again later."
            raise ProblemError(Refusal.TOO_MANY_CLIENTS, detail)
        return StreamingResponse(
            stream.follow(last_event_id or after), media_type="text/event-stream", headers=HEADERS
        )

    return router
