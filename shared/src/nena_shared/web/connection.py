"""A connection to the HTTP server: who asks nothing does not keep it, and no address has all of them."""

from __future__ import annotations

import asyncio
import logging
import time
from typing import Final

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from nena_shared.log import get_logger
from nena_shared.web.rate_limit import RateLimit

log = get_logger(__name__)

HEAD_PATIENCE = 10.0
"""Seconds that the head of a request may take, from the connection or from its first byte on."""

PER_ADDRESS = 256
"""Connections that one address may have; a proxy, from whose address all of them come, is not counted.
Without a bound one machine takes all that the system lets a program have open, 1024 by default."""

_told = RateLimit(rate=1 / 60, burst=1)


class _Seldom(logging.Filter):
    """Lets the same warning pass once in a minute: each broken request would write a line."""

    def __init__(self) -> None:
        super().__init__()
        self._passed: Final = RateLimit(rate=1 / 60, burst=1)

    def filter(self, record: logging.LogRecord) -> bool:
        """Tell whether a record passes; errors all do."""
        return record.levelno > logging.WARNING or not self._passed.wait(str(record.msg), time.monotonic())


SELDOM: Final = _Seldom()
"""For uvicorn's own log."""


class Connection(H11Protocol):
    """Speaks HTTP as uvicorn does, which by itself waits for a request for ever."""

    _late: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin, unless the address has too many connections already."""
        super().connection_made(transport)
        if self.config.proxy_headers or not self._has_too_many():
            self._await_head()
        else:
            transport.abort()

    def data_received(self, data: bytes) -> None:
        """Take a part of a request."""
        super().data_received(data)
        if self.conn.their_state is h11.IDLE:
            self._await_head()
        else:
            self._stop_waiting()

    def connection_lost(self, exc: Exception | None) -> None:
        """End."""
        self._stop_waiting()
        super().connection_lost(exc)

    def _unsupported_upgrade_warning(self) -> None:
        """Say nothing: Java's client offers HTTP/2 with each request, and is answered all the same."""

    def _await_head(self) -> None:
        if self._late is None:
            self._late = self.loop.call_later(HEAD_PATIENCE, self.transport.abort)

    def _stop_waiting(self) -> None:
        if self._late is not None:
            self._late.cancel()
            self._late = None

    def _has_too_many(self) -> bool:
        address = self.client[0] if self.client else ""
        others = (each.client for each in self.connections if isinstance(each, Connection))
        if sum(client is not None and client[0] == address for client in others) <= PER_ADDRESS:
            return False
        if not _told.wait(address, self.loop.time()):
            log.warning("an address has too many connections: more are closed", address=address)
        return True
