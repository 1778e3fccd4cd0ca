"""The stream of changes under ``/api/v1/events``."""

from __future__ import annotations

from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Header, Query
from starlette.responses import StreamingResponse

from nena_shared.web.event_source import HEADERS
from nena_status_aggregator.event_stream import EventStream
from nena_status_aggregator.rest.problem import ProblemError


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
