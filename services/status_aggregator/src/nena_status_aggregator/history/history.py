"""The history as the rest of the program sees it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from sqlalchemy.exc import SQLAlchemyError

from nena_shared.clock import Clock
from nena_status_aggregator.history import database
from nena_status_aggregator.history.entry import HistoryEntry, HistoryFilter
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.settings import HistorySettings

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
