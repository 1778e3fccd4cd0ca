"""Reports, ``/api/v1/report``: figures of a time range, as JSON and as CSV."""

from __future__ import annotations

import asyncio
from datetime import datetime, timedelta
from typing import Annotated

from fastapi import APIRouter, Depends, Query
from starlette.responses import Response

from nena_shared.clock import Clock, iso
from nena_status_aggregator.api.history import Moment, history_unavailable, require_history
from nena_status_aggregator.api.problem_types import Rejection
from nena_status_aggregator.api.problems import ProblemError, as_json
from nena_status_aggregator.extensions.reports.queries import (
    ENTRIES_LIMIT,
    LONGEST_RANGE,
    TooManyEntriesError,
    compute_report,
)
from nena_status_aggregator.extensions.reports.report import Report, report_csv
from nena_status_aggregator.history.database import milliseconds
from nena_status_aggregator.history.history import History, HistoryUnavailableError

DEFAULT_RANGE = timedelta(days=1)
WAITING_LIMIT = 10
"""Maximum number of reports that are computed or wait for it."""


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
    """Create the routes of reports; None: the history is disabled."""
    router = APIRouter(prefix="/api/v1", tags=["history"])
    queue = ReportQueue(history)

    @router.get("/report", response_model=Report)
    async def report(chosen: Requested) -> Response:
        """Return the figures of a time range of at most 31 days."""
        return as_json(await queue.compute_report(*_range_of(*chosen, clock.now())))

    @router.get("/report.csv", response_class=Response)
    async def csv(chosen: Requested) -> Response:
        """Export the figures of a time range as CSV (RFC 4180), one row per figure."""
        figures = await queue.compute_report(*_range_of(*chosen, clock.now()))
        return Response(report_csv(figures), media_type="text/csv; charset=utf-8")

    return router


class ReportQueue:
    """Computes reports, one after the other."""

    def __init__(self, history: History | None) -> None:
        self._history = history
        self._turn = asyncio.Semaphore(1)
        self._waiting = 0

    async def compute_report(self, since: datetime, until: datetime) -> Report:
        """Compute the report of a time range.

        Raises:
            ProblemError: the history is disabled or unavailable, or the report costs too much.

        """
        history = require_history(self._history)
        if self._waiting >= WAITING_LIMIT:
            detail = "Too many reports are being computed; try again later."
            raise ProblemError(Rejection.TOO_MANY_REPORTS, detail)
        self._waiting += 1
        try:
            async with self._turn:
                return await history.read(compute_report, milliseconds(since), milliseconds(until))
        except HistoryUnavailableError as error:
            raise history_unavailable() from error
        except TooManyEntriesError as error:
            detail = f"The range has more than {ENTRIES_LIMIT} entries; request a shorter range."
            raise ProblemError(Rejection.TOO_MANY_ENTRIES, detail) from error
        finally:
            self._waiting -= 1


def _range_of(since: datetime | None, until: datetime | None, now: datetime) -> tuple[datetime, datetime]:
    """Return the range of a request; it ends now if ``until`` is later.

    Raises:
        ProblemError: it is empty, too long, or begins in the future.

    """
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
    if end - begin > LONGEST_RANGE:
        detail = f"The range from {iso(begin)} to {iso(end)} is longer than {LONGEST_RANGE.days} days."
        raise ProblemError(Rejection.INVALID_RANGE, detail)
    return begin, end
