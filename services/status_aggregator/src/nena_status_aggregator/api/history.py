"""The history, ``/api/v1/history`` (pages and exports), and its replay, ``/api/v1/replay``."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from datetime import datetime, timedelta
from typing import Annotated, Generic, TypeVar

from fastapi import APIRouter, Depends, Query, Request
from pydantic import AfterValidator
from pydantic_core import to_json
from sqlalchemy import Engine
from starlette.responses import Response, StreamingResponse
from typing_extensions import TypedDict

from nena_shared.clock import Clock, in_utc, iso
from nena_shared.web.compression import compressed
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError
from nena_status_aggregator.fleet.events import Code
from nena_status_aggregator.history.database import HistoryEntry, HistoryFilter, milliseconds
from nena_status_aggregator.history.history import (
    Form,
    History,
    HistoryUnavailableError,
    as_csv,
    as_json_lines,
    csv_head,
)
from nena_status_aggregator.history.period import TooManyEntriesError
from nena_status_aggregator.history.replay import Replay
from nena_status_aggregator.history.replay_query import LONGEST_REPLAY, read_replay

Moment = Annotated[datetime, AfterValidator(in_utc)]

LAST_ID = 2**63 - 1
"""Largest row number in the database."""

DEFAULT_RANGE = timedelta(days=1)
WAITING_LIMIT = 10
"""Maximum number of queries in a :class:`QueryQueue`."""

T = TypeVar("T")

NO_NUL = r"^[^\x00]*$"
"""PostgreSQL does not accept NUL in texts."""


class HistoryPage(TypedDict):
    """Entries, newest first; `next` is the `before` of the next page, null on the last."""

    entries: list[HistoryEntry]
    next: int | None


def wanted(
    *,
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
    order_part: Annotated[
        str | None,
        Query(alias="orderPart", description="Part of an order's name.", max_length=600, pattern=NO_NUL),
    ] = None,
    problems: Annotated[
        bool, Query(description="Only failures, errors, stopped robots and lost connections.")
    ] = False,
) -> HistoryFilter:
    """Return the filter of a request."""
    return HistoryFilter(robot, order, code, since, until, order_part=order_part, problems=problems)


Wanted = Annotated[HistoryFilter, Depends(wanted)]


def requested(
    since: Annotated[
        Moment | None, Query(description="Start (inclusive), ISO 8601. Unset: 24 hours before `until`.")
    ] = None,
    until: Annotated[
        Moment | None, Query(description="End (exclusive), ISO 8601; at most now. Unset: now.")
    ] = None,
) -> tuple[datetime | None, datetime | None]:
    """Return the time range of a request."""
    return since, until


Requested = Annotated[tuple[datetime | None, datetime | None], Depends(requested)]


def make_router(history: History | None, clock: Clock) -> APIRouter:
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

    replays = QueryQueue(history, read_replay)

    @router.get("/replay", response_model=Replay)
    async def replay(request: Request, chosen: Requested) -> Response:
        """Return where the robots were in a time range of at most 25 hours, and how they looked."""
        found = await replays.read(*range_of(chosen, clock.now(), LONGEST_REPLAY))
        return await asyncio.to_thread(lambda: compressed(request, to_json(found), "application/json"))

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


class QueryQueue(Generic[T]):
    """Runs a query of time ranges that costs much, such as that of a report, once at a time."""

    def __init__(self, history: History | None, query: Callable[[Engine, int, int], T]) -> None:
        self._history = history
        self._query = query
        self._turn = asyncio.Semaphore(1)
        self._waiting = 0

    async def read(self, since: datetime, until: datetime) -> T:
        """Return the result for a time range.

        Raises:
            ProblemError: the history is disabled or unavailable, or the query costs too much.
        """
        history = require_history(self._history)
        if self._waiting >= WAITING_LIMIT:
            detail = "Too many reports or replays are being computed; try again later."
            raise ProblemError(Rejection.TOO_MANY_REPORTS, detail)
        self._waiting += 1
        try:
            async with self._turn:
                return await history.read(self._query, milliseconds(since), milliseconds(until))
        except HistoryUnavailableError as error:
            raise history_unavailable() from error
        except TooManyEntriesError as error:
            detail = f"The range has more than {error} entries; request a shorter range."
            raise ProblemError(Rejection.TOO_MANY_ENTRIES, detail) from error
        finally:
            self._waiting -= 1


def range_of(
    requested: tuple[datetime | None, datetime | None], now: datetime, longest: timedelta
) -> tuple[datetime, datetime]:
    """Return the range of a request; it ends now if ``until`` is later.

    Raises:
        ProblemError: it is empty, too long, or begins in the future.
    """
    since, until = requested
    end = min(until or now, now)
    try:
        begin = since or end - DEFAULT_RANGE
    except OverflowError as error:
        raise ProblemError(Rejection.INVALID_RANGE, f"until ({iso(end)}) is too early.") from error
    if until is not None and begin >= until:
        detail = f"since ({iso(begin)}) must be before until ({iso(until)})."
        raise ProblemError(Rejection.INVALID_RANGE, detail)
    if begin >= end:
        detail = f"since ({iso(begin)}) must be before the current time ({iso(now)})."
        raise ProblemError(Rejection.INVALID_RANGE, detail)
    if end - begin > longest:
        detail = f"The range from {iso(begin)} to {iso(end)} is longer than {longest}; request a shorter one."
        raise ProblemError(Rejection.INVALID_RANGE, detail)
    return begin, end
