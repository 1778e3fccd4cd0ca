"""Orders that have ended of late, whose last status is still retained at the broker."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from nena_shared.fleet_api.transport_order import TransportOrderStatus

LIMIT: Final = 1000
"""Ends that are kept at a time; above that the topic of the oldest one is cleared at once."""


@dataclass(frozen=True, slots=True)
class _End:
    status: TransportOrderStatus
    clearing: asyncio.TimerHandle


class EndedOrders:
    """Has ``clear`` called with the name of each order ``kept`` seconds after its end.

    Until then a host that was away finds the end at the broker, and a broker that has lost everything is told
    of it again. To be used from the event loop.
    """

    def __init__(self, kept: float, clear: Callable[[str], None]) -> None:
        self._kept = kept
        self._clear = clear
        self._ends: OrderedDict[str, _End] = OrderedDict()

    def add(self, status: TransportOrderStatus) -> None:
        """Keep the end of an order, also one that is told anew."""
        if earlier := self._ends.pop(status.name, None):
            earlier.clearing.cancel()
        clearing = asyncio.get_running_loop().call_later(self._kept, self._forget, status.name)
        self._ends[status.name] = _End(status, clearing)
        if len(self._ends) > LIMIT:
            self._forget(next(iter(self._ends)))

    def statuses(self) -> tuple[TransportOrderStatus, ...]:
        """Give the ends that are kept, the oldest first."""
        return tuple(each.status for each in self._ends.values())

    def close(self) -> None:
        """Clear nothing any more."""
        for each in self._ends.values():
            each.clearing.cancel()
        self._ends.clear()

    def _forget(self, name: str) -> None:
        self._ends.pop(name).clearing.cancel()
        self._clear(name)
