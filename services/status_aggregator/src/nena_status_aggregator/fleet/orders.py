"""Transport orders as the order service tells of them.

The order service keeps the status of each living order at the broker and clears it after the final one, so
the orders that have ended live on only here: as many as the limit leaves room for. The rule when there are
too many: first goes the order that ended longest ago, then, if none has ended, the one that was heard of
longest ago.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderStatus

WAY = 0.9
"""Share of a destination that is done when the vehicle has come there."""


@dataclass(slots=True)
class TrackedOrder:
    """One order."""

    status: TransportOrderStatus
    confirmed: bool = True
    """False: the link was lost since, and nothing has been heard of the order after that."""


class OrderBook:
    """The orders that are known, by name; the one heard of last comes last."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._living: dict[str, TrackedOrder] = {}
        self._ended: dict[str, TrackedOrder] = {}

    def __iter__(self) -> Iterator[TrackedOrder]:
        yield from self._living.values()
        yield from self._ended.values()

    def get(self, name: str) -> TrackedOrder | None:
        """Give an order by its name."""
        return self._living.get(name) or self._ended.get(name)

    def take(self, status: TransportOrderStatus) -> bool:
        """Take in a status; False: it is older than what is known, or the same again.

        A version that went down is news all the same if the order was created at another time: then the
        name has been given anew.
        """
        known = self.get(status.name)
        if known and known.status.created == status.created and status.version <= known.status.version:
            was_confirmed, known.confirmed = known.confirmed, True
            return not was_confirmed
        self.remove(status.name)
        book = self._ended if status.state.final else self._living
        book[status.name] = TrackedOrder(status)
        return True

    def clear(self, name: str) -> bool:
        """Take in that the broker keeps no status any more; tell whether that removes the order.

        After the final status that is the normal end. An order that has not ended is gone: its final status
        was missed.
        """
        return self._living.pop(name, None) is not None

    def remove(self, name: str) -> None:
        """Forget an order."""
        self._living.pop(name, None)
        self._ended.pop(name, None)

    def doubt(self) -> None:
        """Mark all living orders as unconfirmed, because the link was lost."""
        for order in self._living.values():
            order.confirmed = False

    def shrink(self) -> list[str]:
        """Forget orders above the limit; give their names."""
        gone = []
        while len(self._living) + len(self._ended) > self._limit:
            book = self._ended or self._living
            name = next(iter(book))
            del book[name]
            gone.append(name)
        return gone


def progress(status: TransportOrderStatus, last_node: str | None) -> float | None:
    """Percent of a transport order: destinations done, and how much of the present one.

    The way there counts for nine tenths of a destination, what is done there for the rest. ``last_node`` is
    where the processing vehicle was last. None for an order that ended without success.
    """
    if status.state.final:
        return 100.0 if status.state.value == "FINISHED" else None
    if not status.drive_orders:
        return 0.0
    done = sum(each.state is DriveOrderState.FINISHED for each in status.drive_orders)
    return round(100.0 * (done + _share(status, last_node)) / len(status.drive_orders), 1)


def _share(status: TransportOrderStatus, last_node: str | None) -> float:
    index = status.current_drive_order_index
    if not 0 <= index < len(status.drive_orders):
        return 0.0
    current = status.drive_orders[index]
    if current.state is DriveOrderState.OPERATING:
        return WAY
    route = current.route or ()
    if current.state is not DriveOrderState.TRAVELLING or last_node not in route:
        return 0.0
    return WAY * route.index(last_node) / max(1, len(route) - 1)
