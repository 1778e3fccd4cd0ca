"""The audit trail as CSV (RFC 4180)."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import StreamingResponse

from nena_order_service.api.audit import Trail
from nena_shared.csv_cells import harmless
from nena_shared.fleet_api.audit import AuditEntry, AuditPage, AuditQuery, AuditResult
from nena_shared.fleet_api.base import Moment

PATH = "/v1/audit.csv"
FILTERS = ("user", "operation", "object", "result", "since", "until", "oldestFirst")
"""Query parameters: those of the list, without its pages."""
PAGE = 1000
ROWS_AT_ONCE = 25
"""Number of rows written before other tasks run; each takes up to half a millisecond."""

COLUMNS = tuple(field.alias or name for name, field in AuditEntry.model_fields.items())

Text = Annotated[str | None, Query(max_length=200)]


def audit_csv(trail: Trail) -> APIRouter:
    """Create the route of the CSV file; the caller must refuse unknown query parameters."""
    router = APIRouter(tags=["audit"])

    @router.get(PATH, operation_id="auditCsv", response_class=StreamingResponse)
    async def file(
        *,
        user: Text = None,
        operation: Text = None,
        object_: Annotated[str | None, Query(alias="object", max_length=200)] = None,
        result: AuditResult | None = None,
        since: Moment | None = None,
        until: Moment | None = None,
        oldest_first: Annotated[bool, Query(alias="oldestFirst")] = False,
    ) -> StreamingResponse:
        """Export the audit trail as CSV, newest first unless `oldestFirst` is set."""
        wanted = AuditQuery(
            user=user,
            operation=operation,
            object=object_,
            result=result,
            since=since,
            until=until,
            oldest_first=oldest_first,
            limit=PAGE,
        )
        first = await trail.page(wanted)  # an error before the first row is answered as a problem
        return StreamingResponse(_rows(trail, wanted, first), media_type="text/csv; charset=utf-8")

    return router


async def _rows(trail: Trail, wanted: AuditQuery, page: AuditPage) -> AsyncIterator[str]:
    yield _lines([COLUMNS])
    while True:
        for start in range(0, len(page.entries), ROWS_AT_ONCE):
            yield _lines([_cells(each) for each in page.entries[start : start + ROWS_AT_ONCE]])
            await asyncio.sleep(0)
        if page.next is None:
            return
        page = await trail.page(wanted.model_copy(update={"after": page.next}))


def _cells(entry: AuditEntry) -> list[str]:
    row = entry.model_dump(mode="json", by_alias=True)
    return [harmless(value) if isinstance(value, str) else str(value) for value in map(row.get, COLUMNS)]


def _lines(rows: list[list[str]] | list[tuple[str, ...]]) -> str:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue()
