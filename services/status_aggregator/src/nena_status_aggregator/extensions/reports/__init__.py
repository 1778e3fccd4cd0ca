"""Reports: figures of robots and orders over a time range of the history."""

from __future__ import annotations

from collections.abc import Iterable

from fastapi import APIRouter
from starlette.responses import Response

from nena_status_aggregator.api.history import QueryQueue, Requested, range_of
from nena_status_aggregator.api.problems import as_json
from nena_status_aggregator.extension import Extension
from nena_status_aggregator.extensions.reports.queries import LONGEST_RANGE, compute_report
from nena_status_aggregator.extensions.reports.report import Report, report_csv


class Reports(Extension):
    """Serves ``/api/v1/report``."""

    def routers(self) -> Iterable[APIRouter]:
        """Return the routes of reports."""
        router, clock = APIRouter(prefix="/api/v1", tags=["history"]), self.core.clock
        queue = QueryQueue(self.core.history, compute_report)

        @router.get("/report", response_model=Report)
        async def report(chosen: Requested) -> Response:
            """Return the figures of a time range of at most 31 days."""
            return as_json(await queue.read(*range_of(chosen, clock.now(), LONGEST_RANGE)))

        @router.get("/report.csv", response_class=Response)
        async def csv(chosen: Requested) -> Response:
            """Export the figures of a time range as CSV (RFC 4180), one row per figure."""
            figures = await queue.read(*range_of(chosen, clock.now(), LONGEST_RANGE))
            return Response(report_csv(figures), media_type="text/csv; charset=utf-8")

        return (router,)
