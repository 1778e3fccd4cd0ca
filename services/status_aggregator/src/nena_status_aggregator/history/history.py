"""The history as the rest of the program uses it: writer, queries and export formats."""

from __future__ import annotations

import asyncio
import csv
import json
from collections.abc import AsyncIterator, Callable, Iterable
from io import StringIO
from typing import Concatenate, ParamSpec, TypeVar

from sqlalchemy import Engine
from sqlalchemy.exc import SQLAlchemyError

from nena_shared.clock import Clock
from nena_shared.csv_cells import harmless
from nena_status_aggregator.history import database
from nena_status_aggregator.history.database import HistoryEntry, HistoryFilter
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.settings import HistorySettings

COLUMNS = ("id", "time", "code", "robot", "order", "text", "values")

P = ParamSpec("P")
T = TypeVar("T")

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


class HistoryUnavailableError(Exception):
    """The history database is unavailable."""


class History:
    """The history: writes through ``writer``, reads in threads."""

    def __init__(self, settings: HistorySettings, url: str, clock: Clock) -> None:
        """Create the history; nothing is opened before ``writer.open``.

        Raises:
            HistoryError: the URL is unusable.
        """
        self._engine = database.make_engine(url)
        self.writer = HistoryWriter(settings, self._engine, clock)

    async def newest(
        self, wanted: HistoryFilter, *, before: int | None = None, limit: int = 100
    ) -> list[HistoryEntry]:
        """Return a page, newest first, of the entries with numbers below ``before``.

        Raises:
            HistoryUnavailableError: the database is unavailable.
        """
        return await self.read(database.read_newest, wanted, before=before, limit=limit)

    async def pages(self, wanted: HistoryFilter) -> AsyncIterator[list[HistoryEntry]]:
        """Yield all present entries, oldest first, page by page.

        Raises:
            HistoryUnavailableError: the database is unavailable.
        """
        newest = await self.newest(wanted, limit=1)
        last, end = 0, newest[0]["id"] if newest else 0
        while last < end:
            page = await self.read(database.read_oldest, wanted, after=last, upto=end, limit=PAGE)
            if not page:
                return
            last = page[-1]["id"]
            yield page

    async def read(
        self, query: Callable[Concatenate[Engine, P], T], *arguments: P.args, **named: P.kwargs
    ) -> T:
        """Run a query in a thread; raises HistoryUnavailableError if the database is unavailable."""
        try:
            return await asyncio.to_thread(query, self._engine, *arguments, **named)
        except SQLAlchemyError as error:
            raise HistoryUnavailableError from error
