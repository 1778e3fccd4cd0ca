"""The orders that a robot has ended, so that an old message is not carried out twice (section 6.1.4.4)."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, timedelta
from hashlib import sha256
from typing import Final, NamedTuple

from nena_shared.vda5050.order import Order

ENDED_ORDERS_KEPT: Final = 200
"""Ended orders that are remembered; the oldest is dropped for the newest."""
CLOCK_TOLERANCE: Final = timedelta(seconds=60)
"""How far the clocks of two fleet controls, or of fleet control and robot, may differ."""


class OrderHeader(NamedTuple):
    """headerId and timestamp of the order message that was accepted last (section 7.2)."""

    header_id: int
    timestamp: datetime


class OrderHistory:
    """Ended orders by a digest of their orderId, oldest first, and the header that was accepted last.

    A digest has one length for every orderId, so the journal stays small.
    """

    def __init__(self, ended: Iterable[str] = (), last_header: OrderHeader | None = None) -> None:
        self._ended = dict.fromkeys(ended)
        self.last_header = last_header

    @property
    def ended(self) -> tuple[str, ...]:
        """Digests of the ended orders, oldest first."""
        return tuple(self._ended)

    def end(self, order_id: str) -> None:
        """Remember an order that another one replaces; an empty ``order_id`` means that there was none."""
        if not order_id:
            return
        self._ended[_digest(order_id)] = None
        while len(self._ended) > ENDED_ORDERS_KEPT:
            del self._ended[next(iter(self._ended))]

    def accept(self, order: Order, utc: datetime | None) -> None:
        """Remember the header of an accepted order or update; ``utc`` is the robot's time, if it is known.

        A timestamp in the future is not remembered: once the sender's clock is corrected, every new order
        would look old.
        """
        if utc is None or order.timestamp <= utc + CLOCK_TOLERANCE:
            self.last_header = OrderHeader(order.header_id, order.timestamp)

    def replay(self, order: Order) -> str | None:
        """Return why a new ``order`` is a replay of an old message, None if it is not.

        A sender whose counter starts again sends newer timestamps; one whose clock is set back goes on
        counting. Only a message that is older by both is a replay.
        """
        if _digest(order.order_id) in self._ended:
            return f"order '{order.order_id}' was received before and has ended"
        last = self.last_header
        if last is None or order.header_id > last.header_id:
            return None
        if order.timestamp >= last.timestamp - CLOCK_TOLERANCE:
            return None
        return f"the message ({_words(order)}) is older than the last accepted order ({_words(last)})"


def _words(header: OrderHeader | Order) -> str:
    return f"headerId {header.header_id}, {header.timestamp:%Y-%m-%dT%H:%M:%SZ}"


def _digest(order_id: str) -> str:
    return sha256(order_id.encode()).hexdigest()[:32]
