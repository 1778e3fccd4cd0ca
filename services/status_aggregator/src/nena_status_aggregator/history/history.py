"""The history as the rest of the program uses it: writer, queries and export formats."""

from __future__ import annotations

import asyncio
import csv
import json
from collections.abc import AsyncIterator, Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from functools import partial
from io import StringIO

from sqlalchemy.exc import SQLAlchemyError

from nena_shared.clock import Clock
from nena_shared.csv_cells import harmless
from nena_status_aggregator.history import database, report_queries
from nena_status_aggregator.history.database import HistoryEntry, HistoryFilter
from nena_status_aggregator.history.report import Report
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.settings import HistorySettings

COLUMNS = ("id", "time", "code", "robot", "order", "text", "values")

Form = Callable[[Iterable[HistoryEntry]], str]


def csv_head() -> str:
    """Return the header line."""
    return ",".join(COLUMNS) + "\r\n"


def as_csv(entries: Iterable[HistoryEntry]) -> str:
    """Format entries as rows (RFC 4180); the values are JSON in one cell."""
    text = StringIO(newline="")
    writer = csv.writer(text)
    for entry in entries:
        cells = (entry["robot"], entry["order"], entry["text"], json.dumps(entry["values"]))
        writer.writerow((entry["id"], entry["time"], entry["code"], *map(harmless, cells)))
    return text.getvalue()


def as_json_lines(entries: Iterable[HistoryEntry]) -> str:
    """Format each entry as a line of JSON."""
    return "".join(f"{json.dumps(entry)}\n" for entry in entries)


PAGE = 1000
"""Number of entries that an export reads at a time."""

REPORTS_LIMIT = 10
"""Maximum number of reports that are computed or wait for it; they are computed one after the other."""


class HistoryUnavailableError(Exception):
    """The history database is unavailable."""


class TooManyReportsError(Exception):
    """REPORTS_LIMIT reports are being computed or wait for it."""


class History:
    """The history: writes through ``writer``, reads in threads."""

    def __init__(self, settings: HistorySettings, url: str, clock: Clock) -> None:
        """Create the history; nothing is opened before ``writer.open``.

        Raises:
            HistoryError: the URL is unusable.

        """
        self._engine = database.make_engine(url)
        self.writer = HistoryWriter(settings, self._engine, clock)
        self._reporter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="reports")
        self._reports = 0

    async def newest(
        self, wanted: HistoryFilter, *, before: int | None = None, limit: int = 100
    ) -> list[HistoryEntry]:
        """Return a page, newest first, of the entries with numbers below ``before``.

        Raises:
            HistoryUnavailableError: the database is unavailable.

        """
        try:
            return await asyncio.to_thread(
                database.read_newest, self._engine, wanted, before=before, limit=limit
            )
        except SQLAlchemyError as error:
            raise HistoryUnavailableError from error

    async def pages(self, wanted: HistoryFilter) -> AsyncIterator[list[HistoryEntry]]:
        """Yield all present entries, oldest first, page by page.

        Raises:
            HistoryUnavailableError: the database is unavailable.

        """
        newest = await self.newest(wanted, limit=1)
        last, end = 0, newest[0]["id"] if newest else 0
        while last < end:
            try:
                page = await asyncio.to_thread(
                    database.read_oldest, self._engine, wanted, after=last, upto=end, limit=PAGE
                )
            except SQLAlchemyError as error:
                raise HistoryUnavailableError from error
            if not page:
                return
            last = page[-1]["id"]
            yield page

    async def report(self, since: datetime, until: datetime) -> Report:
        """Compute the report of a time range.

        Raises:
            HistoryUnavailableError: the database is unavailable.
            TooManyEntriesError: the range has too many entries.
            TooManyReportsError: too many reports are being computed.

        """
        if self._reports >= REPORTS_LIMIT:
            raise TooManyReportsError
        work = partial(
            report_queries.compute, self._engine, database.milliseconds(since), database.milliseconds(until)
        )
        self._reports += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._reporter, work)
        except SQLAlchemyError as error:
            raise HistoryUnavailableError from error
        finally:
            self._reports -= 1
