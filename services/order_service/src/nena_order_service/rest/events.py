"""The stream of changes at ``/v1/events``."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from typing import Annotated

from fastapi import APIRouter, Header, Query
from starlette.responses import StreamingResponse

from nena_order_service.api.events import EventKind, EventStream, Interest
from nena_shared.fleet_api.base import ObjectName
from nena_shared.web.server_sent_events import HEADERS

LastId = Annotated[str | None, Header(alias="Last-Event-ID", description="Id of the last event received.")]
After = Annotated[str | None, Query(max_length=100, description="The same, for who cannot set headers.")]
Kinds = Annotated[list[EventKind] | None, Query(description="Only events of these kinds.")]
Order = Annotated[ObjectName | None, Query(alias="transportOrder", description="Only this order.")]
Vehicle = Annotated[
    ObjectName | None, Query(description="Only this vehicle, and the orders that it works on.")
]


def make_router(stream: EventStream) -> APIRouter:
    """Make the route over ``stream``."""
    router = APIRouter(prefix="/v1", tags=["events"])

    @router.get("/events", response_class=StreamingResponse)
    async def events(
        kind: Kinds = None,
        transport_order: Order = None,
        vehicle: Vehicle = None,
        last_event_id: LastId = None,
        after: After = None,
    ) -> StreamingResponse:
        """Follow orders and vehicles as server-sent events.

        `transportOrder` and `vehicle` hold their object as it is now; `synced` says that the client is up to
        date; `gap` that too much was missed, or that the id is of no use here (a store from a backup): what
        is not at its end follows, look for the rest in the lists; `heartbeat` that the line stands. Who
        comes back with the id of its last event is told what it has missed.
        """
        interest = Interest(frozenset(kind or EventKind), transport_order, vehicle)
        frames = stream.follow(last_event_id or after, interest)
        first = await anext(frames)  # what goes wrong at first is answered as a problem
        return StreamingResponse(_from(first, frames), media_type="text/event-stream", headers=HEADERS)

    return router


async def _from(first: bytes, rest: AsyncGenerator[bytes, None]) -> AsyncGenerator[bytes, None]:
    try:
        yield first
        async for frames in rest:
            yield frames
    finally:
        await rest.aclose()
