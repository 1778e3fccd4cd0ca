"""Dependencies of orders: which orders wait for which, and what the end of one means for them. Pure."""

from __future__ import annotations

from collections.abc import Iterable

from nena_order_service.orders.transport_order import TransportOrder

NAMES_SHOWN = 3


class Dependencies:
    """Knows of each order that waits which others must be at their end first."""

    def __init__(self) -> None:
        self._waits_for: dict[int, set[str]] = {}
        self._dependents: dict[str, set[int]] = {}

    def wait(self, order: TransportOrder, pending: Iterable[str]) -> None:
        """Let an order wait for those of these names."""
        names = set(pending)
        if names:
            self._waits_for[order.number] = names
        for name in names:
            self._dependents.setdefault(name, set()).add(order.number)

    def settle(self, name: str) -> tuple[int, ...]:
        """Let nobody wait for an order any more; gives the numbers of those that did, oldest first."""
        numbers = tuple(sorted(self._dependents.pop(name, ())))
        for number in numbers:
            names = self._waits_for[number]
            names.discard(name)
            if not names:
                del self._waits_for[number]
        return numbers

    def forget(self, order: TransportOrder) -> None:
        """Let an order wait for nothing any more."""
        for name in self._waits_for.pop(order.number, ()):
            self._dependents[name].discard(order.number)
            if not self._dependents[name]:
                del self._dependents[name]

    def why_waiting(self, order: TransportOrder) -> str:
        """Say what an order waits for; empty for nothing."""
        names = sorted(self._waits_for.get(order.number, ()))
        if not names:
            return ""
        shown = ", ".join(repr(name) for name in names[:NAMES_SHOWN])
        more = f" and {len(names) - NAMES_SHOWN} more" if len(names) > NAMES_SHOWN else ""
        return f"waits until {shown}{more} {'is' if len(names) == 1 else 'are'} FINISHED"
