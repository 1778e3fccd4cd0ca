"""The history, ``/api/v1/history``: pages and exports."""

from __future__ import annotations

from collections.abc import AsyncIterator
from datetime import datetime
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from pydantic import AfterValidator
from starlette.responses import StreamingResponse
from typing_extensions import TypedDict

from nena_shared.clock import in_utc
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.fleet.events import Code
from nena_status_aggregator.history.database import HistoryEntry, HistoryFilter
from nena_status_aggregator.history.history import (
    Form,
    History,
    HistoryUnavailableError,
    as_csv,
    as_json_lines,
    csv_head,
)

Moment = Annotated[datetime, AfterValidator(in_utc)]

LAST_ID = 2**63 - 1
"""Largest row number in the database."""

NO_NUL = r"^[^\x00]*$"
"""PostgreSQL does not accept NUL in texts."""


class HistoryPage(TypedDict):
    """Entries, newest first; `next` is the `before` of the next page, null on the last."""

    entries: list[HistoryEntry]
    next: int | None


def wanted(
    robot: Annotated[
        str | None,
        Query(description="Manufacturer and serial number: `ACME/r1`.", max_length=300, pattern=NO_NUL),
    ] = None,
    order: Annotated[
        str | None, Query(description="Name of a transport order.", max_length=600, pattern=NO_NUL)
    ] = None,
    code: Annotated[
        tuple[Code, ...], Query(description="Only these kinds. Unset: all except `position`.")
    ] = (),
    since: Annotated[Moment | None, Query(description="Earliest time (inclusive), ISO 8601.")] = None,
    until: Annotated[Moment | None, Query(description="Latest time (exclusive), ISO 8601.")] = None,
) -> HistoryFilter:
    """Return the filter of a request."""
    return HistoryFilter(robot, order, code, since, until)


Wanted = Annotated[HistoryFilter, Depends(wanted)]


def make_router(history: History | None) -> APIRouter:
    """Create the routes of the history; None: it is disabled."""
    router = APIRouter(prefix="/api/v1", tags=["history"])

    @router.get("/history")
    async def page(
        chosen: Wanted,
        before: Annotated[
            int | None, Query(ge=1, le=LAST_ID, description="`next` of the previous page.")
        ] = None,
        limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    ) -> HistoryPage:
        """Return a page of events, newest first."""
        try:
            entries = await require_history(history).newest(chosen, before=before, limit=limit)
        except HistoryUnavailableError as error:
            raise history_unavailable() from error
        return {"entries": entries, "next": entries[-1]["id"] if len(entries) == limit else None}

    @router.get("/history.csv", response_class=StreamingResponse)
    async def csv(chosen: Wanted) -> StreamingResponse:
        """Export events as CSV (RFC 4180), oldest first."""
        return await _stream_file(
            require_history(history), chosen, as_csv, "text/csv; charset=utf-8", head=csv_head()
        )

    @router.get("/history.jsonl", response_class=StreamingResponse)
    async def json_lines(chosen: Wanted) -> StreamingResponse:
        """Export events as JSON Lines, oldest first."""
        return await _stream_file(require_history(history), chosen, as_json_lines, "application/jsonl")

    return router


NOTHING: list[HistoryEntry] = []


def require_history(history: History | None) -> History:
    """Return the history; raise a 404 problem if it is disabled."""
    if history is None:
        detail = "The history is disabled. Set --history.url, e.g. to sqlite:///nena-history.db."
        raise ProblemError(Rejection.HISTORY_DISABLED, detail)
    return history


def history_unavailable() -> ProblemError:
    """Return the problem that the database is unavailable."""
    detail = "History database unavailable; see the log of the status aggregator. Try again later."
    return ProblemError(Rejection.HISTORY_UNAVAILABLE, detail)


async def _stream_file(
    history: History, chosen: HistoryFilter, form: Form, media_type: str, *, head: str = ""
) -> StreamingResponse:
    """Return all entries as a stream; the first page is read first, so that errors set the HTTP status."""
    pages = history.pages(chosen)
    try:
        first = await anext(pages, NOTHING)
    except HistoryUnavailableError as error:
        raise history_unavailable() from error

    async def text() -> AsyncIterator[str]:
        yield head + form(first)
        async for page in pages:
            yield form(page)

    return StreamingResponse(text(), media_type=media_type)
