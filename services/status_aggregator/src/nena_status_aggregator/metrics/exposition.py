"""Fleet metrics, and the response of ``/metrics``.

Labels are bounded: conditions, topics, levels and states by their enumerations, error types by a limit.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Iterator
from importlib.metadata import version

from prometheus_client import CollectorRegistry, GCCollector, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.fleet.condition import Condition
from nena_status_aggregator.fleet.statistics import DURATION_BOUNDS, Histogram
from nena_status_aggregator.metrics.robot_series import RobotSeries

DISTRIBUTION = "nena-status-aggregator"


class FleetCollector(Collector):
    """Collects the fleet metrics on each scrape."""

    def __init__(self, aggregator: Aggregator) -> None:
        self._aggregator = aggregator
        self._model = aggregator.model

    def describe(self) -> Iterable[Metric]:
        """Return nothing: the families are known only when collected."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Yield all metric families."""
        yield _gauge(
            "nena_build_info", "Version of the program.", ("version",), [((version(DISTRIBUTION),), 1)]
        )
        yield from self._robots()
        yield from self._errors()
        yield from self._messages()
        yield from self._orders()
        yield from self._work()
        yield from self._link()
        yield from self._events()
        yield from self._history()
        yield _gauge(
            "nena_event_loop_lag_seconds",
            "Longest time in the last minute for which the event loop kept work waiting.",
            (),
            [((), self._aggregator.loop_lag.longest)],
        )

    def _robots(self) -> Iterator[Metric]:
        counts = Counter(robot.condition for robot in self._model.robots)
        yield _gauge(
            "nena_robots",
            "Robots by condition.",
            ("condition",),
            [((each.value,), counts[each]) for each in Condition],
        )
        share = self._aggregator.share
        yield _gauge(
            "nena_robots_share_ratio",
            "Share of the robots monitored by this aggregator, 0 to 1.",
            ("share",),
            [((str(share),), 1 / share.of)],
        )
        yield _counter(
            "nena_robots_forgotten", "Silent robots removed for new ones.",
            (), [((), self._model.statistics.robots_forgotten)],
        )  # fmt: skip
        yield _counter(
            "nena_robot_restarts", "Restarts of the header ID on robots' topics.",
            (), [((), self._model.statistics.restarts)],
        )  # fmt: skip

    def _errors(self) -> Iterator[Metric]:
        active = Counter(
            (self._model.statistics.error_labels.of(each.error_type), each.error_level.value)
            for robot in self._model.robots
            if robot.state is not None
            for each in robot.state.errors
        )
        labels = ("error_type", "error_level")
        yield _gauge("nena_robot_errors", "Active errors of robots.", labels, active.items())
        raised = self._model.statistics.errors_raised.items()
        yield _counter("nena_robot_errors_raised", "Errors raised by robots.", labels, raised)

    def _messages(self) -> Iterator[Metric]:
        statistics = self._model.statistics
        for name, text, counts in (
            ("nena_messages_received", "Messages received, by topic.", statistics.received),
            ("nena_messages_malformed", "Unreadable messages.", statistics.malformed),
            ("nena_messages_missed", "Messages lost, by gaps in headerId.", statistics.missed),
        ):
            yield _counter(name, text, ("topic",), [((kind.value,), n) for kind, n in counts.items()])
        yield _counter(
            "nena_messages_repaired",
            "Values that violated VDA 5050 and were repaired.",
            ("field", "kind"),
            statistics.repaired.items(),
        )
        ignored = (
            ("repeated", statistics.repeated),
            ("late", statistics.late),
            ("robot_limit", statistics.refused),
        )
        yield _counter(
            "nena_messages_ignored",
            "Valid messages that were ignored.",
            ("topic", "reason"),
            [((kind.value, reason), n) for reason, counts in ignored for kind, n in counts.items()],
        )

    def _orders(self) -> Iterator[Metric]:
        statistics = self._model.statistics
        states = Counter(order.status.state for order in self._model.orders)
        yield _gauge(
            "nena_transport_orders",
            "Transport orders by state.",
            ("state",),
            [((each.value,), states[each]) for each in TransportOrderState],
        )
        final = [each.value for each in TransportOrderState if each.final]
        ended = [((state,), statistics.orders_ended.get(state, 0)) for state in final]
        yield _counter("nena_transport_orders_ended", "Transport orders ended.", ("state",), ended)
        yield _counter(
            "nena_transport_orders_forgotten", "Transport orders removed for new ones.",
            (), [((), statistics.orders_forgotten)],
        )  # fmt: skip
        durations = HistogramMetricFamily(
            "nena_transport_order_duration_seconds",
            "Time from an order's creation to its end.",
            labels=("state",),
        )
        for state in final:
            durations.add_metric((state,), *_buckets(statistics.order_durations.get(state, Histogram())))
        yield durations

    def _work(self) -> Iterator[Metric]:
        statistics = self._model.statistics
        yield _counter(
            "nena_robot_orders_taken", "Orders and order updates accepted by robots.", ("kind",),
            [(("order",), statistics.robot_orders_taken), (("update",), statistics.robot_order_updates)],
        )  # fmt: skip
        outcomes = [((outcome.value,), count) for outcome, count in statistics.robot_orders_ended.items()]
        yield _counter(
            "nena_robot_orders_ended",
            "Orders of robots that ended.",
            ("outcome",),
            outcomes,
        )
        yield _counter(
            "nena_robot_nodes_reached", "Nodes reached by robots.", (), [((), statistics.nodes_reached)]
        )
        actions = [((status.value,), count) for status, count in statistics.actions_ended.items()]
        yield _counter("nena_robot_actions_ended", "Actions ended.", ("status",), actions)

    def _link(self) -> Iterator[Metric]:
        state = self._aggregator.link.mqtt.state
        up = [((), int(state.connected))]
        yield _gauge("nena_mqtt_connected", "1 while connected to the broker.", (), up)
        for name, text, count in (
            ("nena_mqtt_connects", "Connections made to the broker.", state.connects),
            ("nena_mqtt_received", "MQTT messages received.", state.received),
            ("nena_mqtt_handler_failures", "MQTT messages whose handler failed.", state.handler_failures),
        ):
            yield _counter(name, text, (), [((), count)])

    def _events(self) -> Iterator[Metric]:
        stream = self._aggregator.events
        clients = [((), stream.clients)]
        yield _gauge("nena_event_clients", "Event stream clients.", (), clients)
        for name, text, count in (
            ("nena_events", "Events published on the event stream.", stream.events),
            ("nena_event_snapshots", "Snapshots sent to new and slow clients.", stream.snapshots),
        ):
            yield _counter(name, text, (), [((), count)])

    def _history(self) -> Iterator[Metric]:
        history = self._aggregator.history
        writer = history.writer if history else None
        waiting = [((), writer.waiting if writer else 0)]
        yield _gauge("nena_history_waiting", "Events waiting to be written to the history.", (), waiting)
        for name, text, count in (
            ("nena_history_written", "Events written to the history.", writer.written if writer else 0),
            (
                "nena_history_dropped",
                "Events dropped before they were written.",
                writer.dropped if writer else 0,
            ),
            (
                "nena_history_failures",
                "Failed accesses to the history database.",
                writer.failures if writer else 0,
            ),
        ):
            yield _counter(name, text, (), [((), count)])


Samples = Iterable[tuple[tuple[str, ...], float]]


def _gauge(name: str, text: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    family = GaugeMetricFamily(name, text, labels=labels)
    for values, sample in samples:
        family.add_metric(values, sample)
    return family


def _counter(name: str, text: str, labels: tuple[str, ...], samples: Samples) -> Metric:
    """Create a counter; the text format adds ``_total`` to its name."""
    family = CounterMetricFamily(name, text, labels=labels)
    for values, sample in samples:
        family.add_metric(values, sample)
    return family


def _buckets(durations: Histogram) -> tuple[list[tuple[str, float]], float]:
    """Return cumulative buckets and the sum, as the text format needs them."""
    running = 0
    buckets: list[tuple[str, float]] = []
    for bound, count in zip((*DURATION_BOUNDS, float("inf")), durations.counts, strict=True):
        running += count
        buckets.append(("+Inf" if bound == float("inf") else str(bound), running))
    return buckets, durations.total


class Exposition:
    """Writes the metrics of fleet, robots and process."""

    def __init__(self, aggregator: Aggregator) -> None:
        self._aggregator = aggregator
        self._robot_series = RobotSeries()
        self._registry = CollectorRegistry()
        self._registry.register(FleetCollector(aggregator))
        ProcessCollector(registry=self._registry)
        GCCollector(registry=self._registry)

    def parts(self) -> Iterator[bytes]:
        """Yield the text format 0.0.4 in parts of at most a few milliseconds each."""
        yield generate_latest(self._registry)
        model, now = self._aggregator.model, self._aggregator.now()
        for family in self._robot_series.families(list(model.robots), now):
            yield family.encode()

    async def stream(self) -> AsyncIterator[bytes]:
        """Yield all parts; the event loop runs other tasks in between."""
        for part in self.parts():
            yield part
            await asyncio.sleep(0)
