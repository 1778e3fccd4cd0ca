"""The history as the rest of the program sees it."""

from __future__ import annotations

import asyncio
import csv
import json
from collections.abc import AsyncIterator, Callable, Iterable
from io import StringIO

from sqlalchemy.exc import SQLAlchemyError

from nena_shared.clock import Clock
from nena_status_aggregator.history import database
from nena_status_aggregator.history.database import HistoryEntry, HistoryFilter
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.settings import HistorySettings

COLUMNS = ("id", "time", "code", "robot", "order", "text", "values")

FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
"""A cell that begins so is run by spreadsheets; what robots say must not be."""

Form = Callable[[Iterable[HistoryEntry]], str]


def csv_head() -> str:
    """Write the names of the columns."""
    return ",".join(COLUMNS) + "\r\n"


def as_csv(entries: Iterable[HistoryEntry]) -> str:
    """Write entries as rows (RFC 4180); the values are JSON in one cell."""
    text = StringIO(newline="")
    writer = csv.writer(text)
    for entry in entries:
        cells = (entry["robot"], entry["order"], entry["text"], json.dumps(entry["values"]))
        writer.writerow((entry["id"], entry["time"], entry["code"], *map(_harmless, cells)))
    return text.getvalue()


def as_json_lines(entries: Iterable[HistoryEntry]) -> str:
    """Write each entry as JSON in a line of its own."""
    return "".join(f"{json.dumps(entry)}\n" for entry in entries)


def _harmless(cell: str | None) -> str:
    return f"'{cell}" if cell and cell.startswith(FORMULA_SIGNS) else cell or ""


PAGE = 1000
"""Entries that an export reads at a time, so that its length does not matter."""


class HistoryAwayError(Exception):
    """The database does not answer at the moment."""


class History:
    """Writes by ``writer``; reads in threads, so that a long search holds nobody."""

    def __init__(self, settings: HistorySettings, url: str, clock: Clock) -> None:
        """Prepare the history; nothing is opened before ``writer.open``.

        Raises:
            HistoryError: the URL names no database that can be used.

        """
        self._engine = database.make_engine(url)
        self.writer = HistoryWriter(settings, self._engine, clock)

    async def newest(
        self, wanted: HistoryFilter, *, before: int | None = None, limit: int = 100
    ) -> list[HistoryEntry]:
        """Give a page, newest first; ``before``: number of the last entry had already.

        Raises:
            HistoryAwayError: the database does not answer.

        """
        try:
            return await asyncio.to_thread(
                database.read_newest, self._engine, wanted, before=before, limit=limit
            )
        except SQLAlchemyError as error:
            raise HistoryAwayError from error

    async def pages(self, wanted: HistoryFilter) -> AsyncIterator[list[HistoryEntry]]:
        """Yield all entries that there are now, oldest first, page by page.

        Raises:
            HistoryAwayError: the database does not answer.

        """
        newest = await self.newest(wanted, limit=1)
        last, end = 0, newest[0]["id"] if newest else 0
        while last < end:
            try:
                page = await asyncio.to_thread(
                    database.read_oldest, self._engine, wanted, after=last, upto=end, limit=PAGE
                )
            except SQLAlchemyError as error:
                raise HistoryAwayError from error
            if not page:
                return
            last = page[-1]["id"]
            yield page
