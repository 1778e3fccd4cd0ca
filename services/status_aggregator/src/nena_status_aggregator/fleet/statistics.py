"""Counters of the fleet model as plain numbers; converted to metrics on each scrape."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderStatus
from nena_shared.histogram import Histogram
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.v2_1.state import WRITTEN
from nena_status_aggregator.fleet.events import Code, Outcome, Values
from nena_status_aggregator.fleet.messages import MessageKind

DURATION_BOUNDS = (5.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0, 7200.0, 14400.0)
"""Upper bounds of the histogram buckets of order durations, s."""

ERROR_LABELS = 100
"""Maximum number of error types as metric labels; robots may define their own."""

OTHER = "other"
LABEL_LENGTH = 64


class BoundedLabels:
    """Limits the number of values of a metric label; further values count as ``other``."""

    def __init__(self, limit: int, known: Iterable[str] = ()) -> None:
        self._limit = limit
        self._known = dict.fromkeys(known)

    def label_for(self, value: str) -> str:
        """Return ``value``, or ``other`` if there are too many values or it is too long."""
        if value in self._known:
            return value
        if len(self._known) >= self._limit or len(value) > LABEL_LENGTH or not value.isprintable():
            return OTHER
        self._known[value] = None
        return value


def _per_kind() -> dict[MessageKind, int]:
    return dict.fromkeys(MessageKind, 0)


@dataclass(slots=True)
class Statistics:
    """Counters since the start of the program."""

    error_labels: BoundedLabels = field(
        default_factory=lambda: BoundedLabels(ERROR_LABELS, {*ErrorType, *WRITTEN.values()})
    )
    """Metric labels for error types."""
    received: dict[MessageKind, int] = field(default_factory=_per_kind)
    malformed: dict[MessageKind, int] = field(default_factory=_per_kind)
    repaired: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """Repaired values by topic with field, and kind of repair."""
    repeated: dict[MessageKind, int] = field(default_factory=_per_kind)
    late: dict[MessageKind, int] = field(default_factory=_per_kind)
    missed: dict[MessageKind, int] = field(default_factory=_per_kind)
    refused: dict[MessageKind, int] = field(default_factory=_per_kind)
    """Messages of robots beyond the robot limit."""
    too_many: dict[MessageKind, int] = field(default_factory=_per_kind)
    """Messages beyond ``messages_per_second``."""
    restarts: int = 0
    robots_forgotten: int = 0
    orders_forgotten: int = 0
    errors_raised: dict[tuple[str, str], int] = field(default_factory=dict)
    """By error type label and level."""
    robot_orders_taken: int = 0
    robot_order_updates: int = 0
    robot_orders_ended: dict[Outcome, int] = field(default_factory=lambda: dict.fromkeys(Outcome, 0))
    nodes_reached: int = 0
    actions_ended: dict[ActionStatus, int] = field(
        default_factory=lambda: {status: 0 for status in ActionStatus if status.ended}
    )
    orders_ended: dict[str, int] = field(default_factory=dict)
    """By outcome."""
    order_durations: dict[str, Histogram] = field(default_factory=dict)
    """By outcome: time from creation to end, s."""

    def count_change(self, code: Code, values: Values) -> None:
        """Count a change between two states of a robot."""
        match code:
            case Code.ERROR_RAISED:
                label = (self.error_labels.label_for(str(values["errorType"])), str(values["errorLevel"]))
                self.errors_raised[label] = self.errors_raised.get(label, 0) + 1
            case Code.ORDER_TAKEN:
                self.robot_orders_taken += 1
            case Code.ORDER_UPDATED:
                self.robot_order_updates += 1
            case Code.ORDER_ENDED:
                self.robot_orders_ended[Outcome(str(values["outcome"]))] += 1
            case Code.NODE_REACHED:
                self.nodes_reached += 1
            case Code.ACTION_ENDED:
                self.actions_ended[ActionStatus(str(values["status"]))] += 1

    def count_ended_order(self, order: TransportOrderStatus) -> None:
        """Count an ended transport order."""
        # A drive to a parking place, dropped for a real order, has neither failed nor succeeded.
        outcome = order.ended_as
        if outcome in (None, OrderOutcome.GAVE_WAY):
            return
        self.orders_ended[outcome] = self.orders_ended.get(outcome, 0) + 1
        if order.finished is not None:
            seconds = max(0.0, (order.finished - order.created).total_seconds())
            self.order_durations.setdefault(outcome, Histogram(DURATION_BOUNDS)).observe(seconds)
