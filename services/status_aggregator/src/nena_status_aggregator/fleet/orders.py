"""Transport orders, as published by the order service.

The order service retains the status of each open order at the broker and clears it after the final one, so
ended orders are kept only here, up to a limit. Beyond the limit the order that ended first is removed. Open
orders have a higher limit of their own; beyond it, the one whose last status is oldest is removed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderStatus

DRIVING_SHARE = 0.9
"""Progress within a destination, 0 to 1, on arrival of the vehicle; the operation there is the rest."""


@dataclass(slots=True)
class TrackedOrder:
    """A transport order and whether its status is current."""

    status: TransportOrderStatus
    confirmed: bool = True
    """False if the broker connection was lost and no status has been received since."""


class OrderRegistry:
    """Known orders by name, in the order of their last status."""

    def __init__(self, limit: int, open_limit: int = 0) -> None:
        """``limit`` is for all orders; open ones alone may be up to ``open_limit``, if that is more."""
        self._limit = limit
        self._open_limit = max(limit, open_limit)
        self.open_removed = 0
        """Number of orders removed beyond the limit that had not ended."""
        self._open: dict[str, TrackedOrder] = {}
        self._ended: dict[str, TrackedOrder] = {}

    def __iter__(self) -> Iterator[TrackedOrder]:
        yield from self._open.values()
        yield from self._ended.values()

    def get(self, name: str) -> TrackedOrder | None:
        """Return an order by its name."""
        return self._open.get(name) or self._ended.get(name)

    def apply_status(self, status: TransportOrderStatus) -> bool:
        """Apply a status; return False if it is older than or equal to the known one."""
        order = self.get(status.name)
        # A lower version with another creation time is a new order of the same name.
        if order and order.status.created == status.created and status.version <= order.status.version:
            # The broker repeats retained statuses after a reconnection: the order still exists.
            was_confirmed, order.confirmed = order.confirmed, True
            return not was_confirmed
        self.remove(status.name)
        orders = self._ended if status.state.final else self._open
        orders[status.name] = TrackedOrder(status)
        return True

    def remove_open(self, name: str) -> bool:
        """Remove an order that has not ended; return whether there was one."""
        return self._open.pop(name, None) is not None

    def remove(self, name: str) -> None:
        """Remove an order."""
        self._open.pop(name, None)
        self._ended.pop(name, None)

    def mark_unconfirmed(self) -> None:
        """Mark all open orders as unconfirmed after a loss of the broker connection."""
        for order in self._open.values():
            order.confirmed = False

    def remove_excess(self) -> list[str]:
        """Remove orders beyond the limits; return their names."""
        excess = len(self._open) + len(self._ended) - self._limit
        ended = [*islice(self._ended, max(0, excess))]
        still_open = [*islice(self._open, max(0, len(self._open) - self._open_limit))]
        self.open_removed += len(still_open)
        removed = [*ended, *still_open]
        for name in removed:
            self.remove(name)
        return removed


def order_progress(status: TransportOrderStatus, last_node: str | None) -> float | None:
    """Return the progress of a transport order, percent; None if it ended without success.

    ``last_node`` is the last node of the processing vehicle.
    """
    if status.state.final:
        return 100.0 if status.state.value == "FINISHED" else None
    if not status.drive_orders:
        return 0.0
    completed = float(sum(order.state is DriveOrderState.FINISHED for order in status.drive_orders))
    index = status.current_drive_order_index
    if 0 <= index < len(status.drive_orders):
        current = status.drive_orders[index]
        route = current.route or ()
        if current.state is DriveOrderState.OPERATING:
            completed += DRIVING_SHARE
        elif current.state is DriveOrderState.TRAVELLING and last_node in route:
            completed += DRIVING_SHARE * route.index(last_node) / max(1, len(route) - 1)
    return round(100.0 * completed / len(status.drive_orders), 1)
