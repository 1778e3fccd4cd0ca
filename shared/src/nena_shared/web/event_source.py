"""What streams of server-sent events have in common: headers, heartbeats, and waiting for what is new."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

HEADERS: Final[Mapping[str, str]] = MappingProxyType({"cache-control": "no-store", "x-accel-buffering": "no"})
"""Neither caches nor proxies may hold events back."""

HEARTBEAT: Final = 5.0
"""Seconds without an event after which a heartbeat is sent, so that both ends notice a dead line."""

HEARTBEAT_FRAME: Final = b"event: heartbeat\ndata: {}\n\n"


class News:
    """Wakes all at once who wait for something new, however many they are."""

    def __init__(self) -> None:
        self._next = asyncio.Event()

    @property
    def next(self) -> asyncio.Event:
        """Set once something newer comes; to be taken before one looks at what there is."""
        return self._next

    def came(self) -> None:
        """Wake all who wait; who takes :attr:`next` from now on waits for what comes after this."""
        self._next.set()
        self._next = asyncio.Event()


async def nothing_within(news: asyncio.Event, seconds: float) -> bool:
    """Wait for news; tell whether there was none for so long."""
    try:
        async with asyncio.timeout(seconds):
            await news.wait()
    except TimeoutError:
        return True
    return False
