"""The audit trail as CSV (RFC 4180)."""

from __future__ import annotations

import asyncio
import csv
import io
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.responses import StreamingResponse

from nena_order_service.api.operation_routes import known_query, refusals_of
from nena_shared.csv_cells import harmless
from nena_shared.fleet_api.audit import AuditEntry, AuditFilter, AuditPage, AuditQuery
from nena_shared.fleet_api.refusals import Refusal

PATH = "/v1/audit.csv"
PAGE = 1000

FILTERS = tuple(field.alias or name for name, field in AuditFilter.model_fields.items())
COLUMNS = tuple(field.alias or name for name, field in AuditEntry.model_fields.items())

ReadPage = Callable[[AuditQuery], Awaitable[AuditPage]]


def audit_csv(read: ReadPage) -> APIRouter:
    """Create the route of the CSV file; ``read`` reads a page of the trail."""
    router = APIRouter(tags=["audit"])

    @router.get(
        PATH,
        operation_id="auditCsv",
        response_class=StreamingResponse,
        dependencies=[known_query(*FILTERS)],
        responses=refusals_of((Refusal.NOT_SAVED,)),
    )
    async def file(chosen: Annotated[AuditFilter, Query()]) -> StreamingResponse:
        """Export the audit trail as CSV, newest first unless `oldestFirst` is set."""
        wanted = AuditQuery(**dict(chosen), limit=PAGE)
        first = await read(wanted)  # an error before the first row is answered as a problem
        return StreamingResponse(_csv_rows(read, wanted, first), media_type="text/csv; charset=utf-8")

    return router


async def _csv_rows(read: ReadPage, wanted: AuditQuery, page: AuditPage) -> AsyncIterator[str]:
    yield ",".join(COLUMNS) + "\r\n"
    while True:
        yield await asyncio.to_thread(_csv_lines, page.entries)  # a page takes up to half a second
        if page.next is None:
            return
        page = await read(wanted.model_copy(update={"after": page.next}))


def _csv_lines(entries: Iterable[AuditEntry]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    for entry in entries:
        values = map(entry.model_dump(mode="json", by_alias=True).get, COLUMNS)
        # Hosts choose names and reasons, which a spreadsheet could take for formulas.
        writer.writerow(harmless(value) if isinstance(value, str) else str(value) for value in values)
    return text.getvalue()
