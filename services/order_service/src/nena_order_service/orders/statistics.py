"""Count the results of transport orders for the metrics, from committed versions only."""

from __future__ import annotations

from enum import StrEnum
from typing import Final

from nena_order_service.orders.transport_order import EventCode, TransportOrder
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.histogram import LONG, Histogram

S = TransportOrderState


class Wait(StrEnum):
    """Kind of wait of an order while no vehicle works on it."""

    DEPENDENCY = "dependency"
    """Waits for other orders, which have to be finished first."""
    VEHICLE = "vehicle"
    RETRY = "retry"
    """Waits for its next try after a failure."""
    HOLD = "hold"
    """Waits for a person to resume it."""


WAITS: Final = {S.ACTIVE: Wait.DEPENDENCY, S.DISPATCHABLE: Wait.VEHICLE}


def wait_of(order: TransportOrder) -> Wait | None:
    """Return what an order waits for; None: it has ended, or a vehicle works on it."""
    status = order.status
    if status.state.final:
        return None
    if status.held:
        return Wait.HOLD
    if status.next_try:
        return Wait.RETRY
    return WAITS.get(status.state)


class OrderStatistics:
    """Counts since the start of the program, and how many orders are in each state now."""

    def __init__(self) -> None:
        self.present = {state: 0 for state in TransportOrderState if not state.final}
        self.waits = dict.fromkeys(Wait, 0)
        self.ended = dict.fromkeys(OrderOutcome, 0)
        self.created = 0
        self.late = 0
        self.events = dict.fromkeys((code.value for code in EventCode), 0)
        """Number of history entries by event code."""
        self.assignment = Histogram(LONG)
        """Seconds from creation to first assignment."""
        self.durations = {outcome: Histogram(LONG) for outcome in OrderOutcome}
        """Seconds from creation to end, by outcome."""

    def loaded(self, order: TransportOrder) -> None:
        """Count an order from before the restart in its current state."""
        self._count_change(None, order)

    def changed(self, before: TransportOrder | None, order: TransportOrder) -> None:
        """Count the new version of an order; ``before`` is the previous one, None for a new order."""
        self._count_change(before, order)
        status, was = order.status, before.status if before else None
        for entry in status.history[len(was.history) if was else 0 :]:
            if entry.event_code in self.events:
                self.events[entry.event_code] += 1
        self.created += was is None
        self.late += status.late and not (was and was.late)
        if status.assigned and not (was and was.assigned):
            self.assignment.observe((status.assigned - status.created).total_seconds())
        if (outcome := status.outcome) and not (was and was.state.final):
            self.ended[outcome] += 1
            if status.finished:
                self.durations[outcome].observe((status.finished - status.created).total_seconds())

    def _count_change(self, before: TransportOrder | None, order: TransportOrder) -> None:
        for version, step in ((before, -1), (order, 1)):
            if version is None or version.state.final:
                continue
            self.present[version.state] += step
            if wait := wait_of(version):
                self.waits[wait] += step
