"""The table of the fleet's metrics, and the response of ``/metrics``.

Labels are bounded: conditions, topics, levels and states by their enumerations, error types by a limit.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from importlib.metadata import version
from typing import Final

from nena_shared import metrics
from nena_shared.fleet_api.attention import MatterKind
from nena_shared.fleet_api.service_status import LOST_AFTER
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.histogram import Histogram
from nena_shared.metrics import (
    LabelValues,
    Section,
    certificate_metrics,
    counter,
    gauge,
    histogram,
    link_metrics,
)
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.fleet.condition import Condition
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.statistics import DURATION_BOUNDS
from nena_status_aggregator.history.writer import HistoryWriter
from nena_status_aggregator.metrics.robot_series import robot_families

DISTRIBUTION = "nena-status-aggregator"


def _count_robots(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    counts = Counter(robot.condition for robot in aggregator.model.robots)
    return {condition.value: counts[condition] for condition in Condition}


NAMES_SHOWN = 5


def _count_jams(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    """Return the robots of each jam by its head; of a circle by its first vehicles."""
    robots: dict[LabelValues, float] = {}
    for jam in aggregator.model.queues.find_jams(aggregator.now()):
        more = ", …" if len(jam.end) > NAMES_SHOWN else ""
        head = ", ".join(jam.end[:NAMES_SHOWN]) + more
        robots[head, "circle" if jam.circle else "vehicle"] = jam.robots
    return robots


def _count_matters(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    counts = Counter(
        (each.kind, each.acknowledged is not None) for each in aggregator.model.attention.matters
    )
    return {
        (kind.value, "yes" if done else "no"): counts[kind, done]
        for kind in MatterKind
        for done in (False, True)
    }


def _active_errors(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    label = aggregator.model.statistics.error_labels.label_for
    return Counter(
        (label(error.error_type), error.error_level.value)
        for robot in aggregator.model.robots
        if robot.state is not None
        for error in robot.state.errors
    )


def _count_ignored(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    statistics = aggregator.model.statistics
    reasons = (
        ("repeated", statistics.repeated),
        ("late", statistics.late),
        ("robot_limit", statistics.refused),
        ("rate", statistics.too_many),
    )
    return {(kind.value, reason): count for reason, counts in reasons for kind, count in counts.items()}


def _by_kind(counts: Mapping[MessageKind, int]) -> Mapping[LabelValues, float]:
    return {kind.value: count for kind, count in counts.items()}


def _count_orders(aggregator: Aggregator) -> Mapping[LabelValues, float]:
    states = Counter(order.status.state for order in aggregator.model.orders)
    return {state.value: states[state] for state in TransportOrderState}


OUTCOMES: Final = tuple(each.value for each in OrderOutcome if each is not OrderOutcome.GAVE_WAY)


def _writer_of(aggregator: Aggregator) -> HistoryWriter | None:
    return aggregator.history.writer if aggregator.history else None


ROBOTS: Final[Section[Aggregator]] = Section(
    "Robots",
    (
        gauge("nena_robots", "Robots by condition.", _count_robots, "condition"),
        gauge(
            "nena_jam_robots",
            "Robots that wait behind one head: more than `jam.robots` for longer than `jam.seconds`; absent "
            "without a jam. `head` is the vehicle that all of them wait for in the end, `kind` is `vehicle`; "
            "or `head` has the vehicles that wait for each other, `kind` is `circle`.",
            _count_jams,
            "head",
            "kind",
        ),
        gauge(
            "nena_attention",
            "Matters that need a person, as in the attention list of the panel: "
            + ", ".join(f"`{kind.value}`" for kind in MatterKind)
            + ". `acknowledged` is `yes` or `no`.",
            _count_matters,
            "kind",
            "acknowledged",
        ),
        gauge(
            "nena_robots_share_ratio",
            "Share of the robots that this aggregator monitors: 0.5 for `1/2`, 1 for `1/1` (all robots).",
            lambda s: {str(s.share): 1 / s.share.of},
            "share",
        ),
        counter(
            "nena_robots_forgotten_total",
            "Silent robots removed for new ones.",
            lambda s: s.model.statistics.robots_forgotten,
        ),
        counter(
            "nena_robot_restarts_total",
            "Restarts of headerId on robots' topics.",
            lambda s: s.model.statistics.restarts,
        ),
        gauge(
            "nena_robot_errors",
            "Active errors of all robots. Levels: `WARNING`, `URGENT`, `CRITICAL`, `FATAL`.",
            _active_errors,
            "error_type",
            "error_level",
        ),
        counter(
            "nena_robot_errors_raised_total",
            "Errors raised by robots.",
            lambda s: s.model.statistics.errors_raised,
            "error_type",
            "error_level",
        ),
        counter(
            "nena_robot_orders_taken_total",
            "VDA 5050 orders accepted by robots: `order` for new orders, `update` for order updates.",
            lambda s: {
                "order": s.model.statistics.robot_orders_taken,
                "update": s.model.statistics.robot_order_updates,
            },
            "kind",
        ),
        counter(
            "nena_robot_orders_ended_total",
            "Orders of robots that ended: `completed`, `abandoned` (cancelled or failed), `unseen` (another "
            "order followed at once).",
            lambda s: {outcome.value: n for outcome, n in s.model.statistics.robot_orders_ended.items()},
            "outcome",
        ),
        counter(
            "nena_robot_nodes_reached_total",
            "Nodes reached by robots.",
            lambda s: s.model.statistics.nodes_reached,
        ),
        counter(
            "nena_robot_actions_ended_total",
            "Actions ended: `FINISHED`, `FAILED`.",
            lambda s: {status.value: n for status, n in s.model.statistics.actions_ended.items()},
            "status",
        ),
    ),
    "`condition` is one of " + ", ".join(f"`{condition.value}`" for condition in Condition) + ".",
)

MESSAGES: Final[Section[Aggregator]] = Section(
    "Messages",
    (
        counter(
            "nena_messages_received_total",
            "Messages received.",
            lambda s: _by_kind(s.model.statistics.received),
            "topic",
        ),
        counter(
            "nena_messages_malformed_total",
            "Unreadable messages.",
            lambda s: _by_kind(s.model.statistics.malformed),
            "topic",
        ),
        counter(
            "nena_messages_repaired_total",
            "Values that violated VDA 5050 and were repaired, e.g. `state.agvPosition.theta`, "
            "`angle_wrapped`.",
            lambda s: s.model.statistics.repaired,
            "field",
            "kind",
        ),
        counter(
            "nena_messages_missed_total",
            "Messages lost, by gaps in headerId.",
            lambda s: _by_kind(s.model.statistics.missed),
            "topic",
        ),
        counter(
            "nena_messages_ignored_total",
            "Messages that were ignored: `repeated`, `late`, `robot_limit` (from a robot beyond "
            "`robots_limit`), or `rate` (beyond `messages_per_second`).",
            _count_ignored,
            "topic",
            "reason",
        ),
    ),
    "`topic` is one of " + ", ".join(f"`{kind.value}`" for kind in MessageKind) + ".",
)

ORDERS: Final[Section[Aggregator]] = Section(
    "Order service and transport orders",
    (
        gauge(
            "nena_transport_orders",
            "Known orders, at most `orders_limit` (1000), or `open_orders_limit` (10000) open ones.",
            _count_orders,
            "state",
        ),
        counter(
            "nena_transport_orders_ended_total",
            "Orders that ended while the aggregator was running, by their outcome, except those that gave "
            "way to another one.",
            # From the first scrape on with 0: a rate needs a value before the first order ends.
            lambda s: {state: s.model.statistics.orders_ended.get(state, 0) for state in OUTCOMES},
            "state",
        ),
        counter(
            "nena_transport_orders_forgotten_total",
            "Orders removed for new ones.",
            lambda s: s.model.statistics.orders_forgotten,
        ),
        counter(
            "nena_transport_orders_open_forgotten_total",
            "Those of them that had not ended (`open_orders_limit`); panel and metrics lack them.",
            lambda s: s.model.orders.open_removed,
        ),
        gauge(
            "nena_order_service_up",
            f"1 while the active order service sends heartbeats over MQTT, 0 {LOST_AFTER:g} s after the "
            "last one or at its last will; absent if none was received, and without the broker.",
            lambda s: s.model.order_service.is_up(s.now()),
        ),
        gauge(
            "nena_order_service_takes_orders",
            "1 while the order service can write its store, by its last heartbeat.",
            lambda s: s.model.order_service.store_ready,
        ),
        gauge(
            "nena_order_service_clock_skew_seconds",
            "Clock of the order service minus that of the aggregator.",
            lambda s: s.model.order_service.skew.seconds,
        ),
        histogram(
            "nena_transport_order_duration_seconds",
            "Time from an order's creation to its end, by its outcome.",
            lambda s: {
                state: s.model.statistics.order_durations.get(state) or Histogram(DURATION_BOUNDS)
                for state in OUTCOMES
            },
            "state",
        ),
    ),
    "`state` is the openTCS state: "
    + ", ".join(f"`{state.value}`" for state in TransportOrderState)
    + "; ended orders are counted by their outcome: "
    + ", ".join(f"`{outcome}`" for outcome in OUTCOMES)
    + ".",
)

PROGRAM: Final[Section[Aggregator]] = Section(
    "Broker connection, events, history, program",
    (
        gauge(
            "nena_build_info",
            "Always 1.",
            lambda _: {version(DISTRIBUTION): 1},
            "version",
        ),
        *link_metrics("nena_mqtt_", lambda s: s.link.mqtt.state),
        *certificate_metrics(lambda s: s.certificates),
        gauge(
            "nena_event_loop_lag_seconds",
            "Longest delay of the event loop in the last minute.",
            lambda s: s.loop_lag.longest,
        ),
        gauge("nena_event_clients", "Event stream clients.", lambda s: s.events.clients),
        counter("nena_events_total", "Events published on the event stream.", lambda s: s.events.events),
        counter(
            "nena_event_snapshots_total",
            "Snapshots sent to new clients and to clients that fell behind.",
            lambda s: s.events.snapshots,
        ),
        gauge(
            "nena_history_waiting",
            "Events waiting to be written to the history.",
            lambda s: writer.waiting if (writer := _writer_of(s)) else 0,
        ),
        counter(
            "nena_history_written_total",
            "Events written to the history.",
            lambda s: writer.written if (writer := _writer_of(s)) else 0,
        ),
        counter(
            "nena_history_dropped_total",
            "Events dropped because the database was too slow or unavailable for too long.",
            lambda s: writer.dropped if (writer := _writer_of(s)) else 0,
        ),
        counter(
            "nena_history_failures_total",
            "Failed accesses to the history database.",
            lambda s: writer.failures if (writer := _writer_of(s)) else 0,
        ),
    ),
)

SECTIONS: Final = (ROBOTS, MESSAGES, ORDERS, PROGRAM)


class Exposition:
    """Writes the metrics of fleet, robots and process."""

    def __init__(self, aggregator: Aggregator) -> None:
        self._aggregator = aggregator
        self._fleet = metrics.Exposition(aggregator, SECTIONS)
        self._extensions = [
            metrics.Exposition(extension, (extension.section,), process=False)
            for extension in aggregator.extensions
            if extension.section
        ]

    def text(self) -> bytes:
        """Return the text format 0.0.4."""
        extensions = b"".join(extension.text() for extension in self._extensions)
        # Written by hand: 20 series for each of many robots, at each scrape.
        robots = robot_families(self._aggregator.model.robots, self._aggregator.now())
        return self._fleet.text() + extensions + robots.encode()
