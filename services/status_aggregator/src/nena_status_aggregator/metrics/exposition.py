"""All that ``/metrics`` says."""

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
    """Reads the aggregator at each scrape."""

    def __init__(self, aggregator: Aggregator) -> None:
        self._aggregator = aggregator
        self._model = aggregator.model

    def describe(self) -> Iterable[Metric]:
        """Give nothing: the families are known only when they are made."""
        return ()

    def collect(self) -> Iterator[Metric]:
        """Make all families."""
        yield _gauge(
            "nena_build_info", "The version that runs.", ("version",), [((version(DISTRIBUTION),), 1)]
        )
        yield from self._robots()
        yield from self._errors()
        yield from self._messages()
        yield from self._orders()
        yield from self._work()
        yield from self._link()
        yield from self._events()
        yield from self._history()

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
            "Share of the robots that is watched here, 0 to 1.",
            ("share",),
            [((str(share),), 1 / share.of)],
        )
        yield _counter(
            "nena_robots_forgotten", "Silent robots that made room for new ones.",
            (), [((), self._model.statistics.robots_forgotten)],
        )  # fmt: skip
        yield _counter(
            "nena_robot_restarts", "Topics of robots on which the counting of messages began again.",
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
        yield _gauge("nena_robot_errors", "Errors that robots report now.", labels, active.items())
        raised = self._model.statistics.errors_raised.items()
        yield _counter("nena_robot_errors_raised", "Errors that robots have begun to report.", labels, raised)

    def _messages(self) -> Iterator[Metric]:
        told = self._model.statistics
        for name, text, counts in (
            ("nena_messages_received", "Messages by topic, whatever became of them.", told.received),
            ("nena_messages_malformed", "Messages that could not be read.", told.malformed),
            ("nena_messages_missed", "Messages that never came, by the gaps of headerId.", told.missed),
        ):
            yield _counter(name, text, ("topic",), [((kind.value,), n) for kind, n in counts.items()])
        ignored = (("repeated", told.repeated), ("late", told.late), ("robot_limit", told.refused))
        yield _counter(
            "nena_messages_ignored",
            "Messages that were read and not used.",
            ("topic", "reason"),
            [((kind.value, reason), n) for reason, counts in ignored for kind, n in counts.items()],
        )

    def _orders(self) -> Iterator[Metric]:
        told = self._model.statistics
        states = Counter(order.status.state for order in self._model.orders)
        yield _gauge(
            "nena_transport_orders",
            "Transport orders that are kept, by state.",
            ("state",),
            [((each.value,), states[each]) for each in TransportOrderState],
        )
        final = [each.value for each in TransportOrderState if each.final]
        ended = [((state,), told.orders_ended.get(state, 0)) for state in final]
        yield _counter("nena_transport_orders_ended", "Transport orders that ended.", ("state",), ended)
        yield _counter(
            "nena_transport_orders_forgotten", "Transport orders that made room for new ones.",
            (), [((), told.orders_forgotten)],
        )  # fmt: skip
        durations = HistogramMetricFamily(
            "nena_transport_order_duration_seconds",
            "Time from an order's creation to its end.",
            labels=("state",),
        )
        for state in final:
            durations.add_metric((state,), *_buckets(told.order_durations.get(state, Histogram())))
        yield durations

    def _work(self) -> Iterator[Metric]:
        told = self._model.statistics
        yield _counter(
            "nena_robot_orders_taken", "Orders and updates that robots show as taken.", ("kind",),
            [(("order",), told.robot_orders_taken), (("update",), told.robot_order_updates)],
        )  # fmt: skip
        outcomes = [((outcome.value,), count) for outcome, count in told.robot_orders_ended.items()]
        yield _counter(
            "nena_robot_orders_ended",
            "Orders of which robots have nothing left to do.",
            ("outcome",),
            outcomes,
        )
        yield _counter(
            "nena_robot_nodes_reached", "Nodes that robots have reached.", (), [((), told.nodes_reached)]
        )
        actions = [((status.value,), count) for status, count in told.actions_ended.items()]
        yield _counter("nena_robot_actions_ended", "Actions that have ended.", ("status",), actions)

    def _link(self) -> Iterator[Metric]:
        state = self._aggregator.link.mqtt.state
        up = [((), int(state.connected))]
        yield _gauge("nena_mqtt_connected", "1 while the link to the broker stands.", (), up)
        for name, text, count in (
            ("nena_mqtt_connects", "Connections made to the broker.", state.connects),
            ("nena_mqtt_received", "MQTT messages received.", state.received),
            ("nena_mqtt_handler_failures", "MQTT messages whose handling failed.", state.handler_failures),
        ):
            yield _counter(name, text, (), [((), count)])

    def _events(self) -> Iterator[Metric]:
        stream = self._aggregator.events
        clients = [((), stream.clients)]
        yield _gauge("nena_event_clients", "Clients that follow the event stream.", (), clients)
        for name, text, count in (
            ("nena_events", "Changes told on the event stream.", stream.events),
            ("nena_event_snapshots", "Snapshots given to new and to slow clients.", stream.snapshots),
        ):
            yield _counter(name, text, (), [((), count)])

    def _history(self) -> Iterator[Metric]:
        history = self._aggregator.history
        writer = history.writer if history else None
        waiting = [((), writer.waiting if writer else 0)]
        yield _gauge("nena_history_waiting", "Happenings that are not written yet.", (), waiting)
        for name, text, count in (
            ("nena_history_written", "Happenings written to the history.", writer.written if writer else 0),
            ("nena_history_dropped", "Happenings that were never written.", writer.dropped if writer else 0),
            (
                "nena_history_failures",
                "Accesses to the database that failed.",
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
    """Make a counter; the text format adds ``_total`` to its name."""
    family = CounterMetricFamily(name, text, labels=labels)
    for values, sample in samples:
        family.add_metric(values, sample)
    return family


def _buckets(durations: Histogram) -> tuple[list[tuple[str, float]], float]:
    """Sum up the classes, as the text format wants them."""
    running = 0
    buckets: list[tuple[str, float]] = []
    for bound, count in zip((*DURATION_BOUNDS, float("inf")), durations.counts, strict=True):
        running += count
        buckets.append(("+Inf" if bound == float("inf") else str(bound), running))
    return buckets, durations.total


class Exposition:
    """Writes the fleet's figures, the robots', and those of the process itself."""

    def __init__(self, aggregator: Aggregator) -> None:
        self._aggregator = aggregator
        self._robot_series = RobotSeries()
        self._registry = CollectorRegistry()
        self._registry.register(FleetCollector(aggregator))
        ProcessCollector(registry=self._registry)
        GCCollector(registry=self._registry)

    def parts(self) -> Iterator[bytes]:
        """Write the text format 0.0.4 in parts, each of which takes a few milliseconds at most."""
        yield generate_latest(self._registry)
        model, now = self._aggregator.model, self._aggregator.now()
        for family in self._robot_series.families(list(model.robots), now):
            yield family.encode()

    async def stream(self) -> AsyncIterator[bytes]:
        """Write everything; between the parts the event loop handles what has come meanwhile."""
        for part in self.parts():
            yield part
            await asyncio.sleep(0)
