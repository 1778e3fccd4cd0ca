"""Metrics of a program as a table that defines the name, help, labels and source of each metric once.

Values are read from the program's state on each scrape; only durations are counted as they occur, in a
:class:`Histogram`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Generic, TypeVar

from prometheus_client import CollectorRegistry, GCCollector, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric as Family
from prometheus_client.registry import Collector

from nena_shared.certificates import Certificates
from nena_shared.histogram import Histogram
from nena_shared.log import get_logger
from nena_shared.mqtt.link import LinkState

log = get_logger(__name__)

S = TypeVar("S")


class MetricKind(StrEnum):
    """Prometheus metric types."""

    GAUGE = "gauge"
    COUNTER = "counter"
    HISTOGRAM = "histogram"


LabelValues = str | tuple[str, ...]
"""The value of one label, or of several in order."""

Reading = float | Histogram | Mapping[Any, float] | Mapping[Any, Histogram] | None
"""Value of a metric without labels, or values by :data:`LabelValues`; None: no value at present."""


@dataclass(frozen=True, slots=True)
class Metric(Generic[S]):
    """A metric; ``S`` is the type of its source."""

    name: str
    """Name as used in queries; counters end with ``_total``."""
    kind: MetricKind
    text: str
    """Help text, one sentence."""
    labels: tuple[str, ...]
    read: Callable[[S], Reading]

    def family(self, source: S) -> Family:
        """Read the metric from its source."""
        reading = self.read(source)
        if reading is None:
            samples: Iterable[tuple[LabelValues, float | Histogram]] = ()
        elif isinstance(reading, Mapping):
            samples = reading.items()
        else:
            samples = [((), reading)]
        family = self._make_family()
        for values, sample in samples:
            labels = (values,) if isinstance(values, str) else values
            if isinstance(family, HistogramMetricFamily):
                assert isinstance(sample, Histogram), self.name  # noqa: S101 - for the type
                family.add_metric(labels, sample.buckets(), sample.total)
            else:
                assert not isinstance(sample, Histogram), self.name  # noqa: S101 - for the type
                family.add_metric(labels, sample)
        return family

    def _make_family(self) -> GaugeMetricFamily | CounterMetricFamily | HistogramMetricFamily:
        match self.kind:
            case MetricKind.GAUGE:
                return GaugeMetricFamily(self.name, self.text, labels=self.labels)
            case MetricKind.COUNTER:
                # the library appends the suffix itself
                return CounterMetricFamily(self.name.removesuffix("_total"), self.text, labels=self.labels)
            case MetricKind.HISTOGRAM:
                return HistogramMetricFamily(self.name, self.text, labels=self.labels)


def gauge(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Define a gauge."""
    return Metric(name, MetricKind.GAUGE, text, labels, read)


def counter(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Define a counter, which starts at 0 with the program; its name ends with ``_total``."""
    return Metric(name, MetricKind.COUNTER, text, labels, read)


def histogram(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Define a histogram of durations in seconds."""
    return Metric(name, MetricKind.HISTOGRAM, text, labels, read)


@dataclass(frozen=True, slots=True)
class Section(Generic[S]):
    """A section of ``docs/metrics.md``."""

    title: str
    metrics: tuple[Metric[S], ...]
    text: str = ""
    """Text about all of its metrics, such as the values of a label."""


class _Table(Collector):
    """Reads a table at each scrape."""

    def __init__(self, source: object, sections: Sequence[Section[Any]]) -> None:
        self._source = source
        self._metrics = [each for section in sections for each in section.metrics]

    def describe(self) -> Iterable[Family]:
        return ()

    def collect(self) -> Iterator[Family]:
        for metric in self._metrics:
            try:
                yield metric.family(self._source)
            except Exception:  # still show the others, which help to find the fault
                log.exception("a metric could not be read", metric=metric.name)


class Exposition:
    """Writes the metrics of a table and of the process in Prometheus's text format."""

    def __init__(self, source: object, sections: Sequence[Section[Any]], *, process: bool = True) -> None:
        """Prepare to read ``sections`` from ``source``, and the metrics of the process unless disabled."""
        self._registry = CollectorRegistry()
        self._registry.register(_Table(source, sections))
        if process:
            ProcessCollector(registry=self._registry)
            GCCollector(registry=self._registry)

    def text(self) -> bytes:
        """Return the text format 0.0.4."""
        return generate_latest(self._registry)


def link_metrics(prefix: str, state: Callable[[S], LinkState]) -> tuple[Metric[S], ...]:
    """Return the metrics of a link to the broker."""
    return (
        gauge(f"{prefix}connected", "1 while connected to the broker.", lambda s: state(s).connected),
        counter(f"{prefix}connects_total", "Connections to the broker.", lambda s: state(s).connects),
        counter(f"{prefix}received_total", "MQTT messages received.", lambda s: state(s).received),
        counter(
            f"{prefix}published_total",
            "MQTT messages acknowledged by the broker.",
            lambda s: state(s).published,
        ),
        counter(
            f"{prefix}dropped_total",
            "MQTT messages not sent: the queue was full, or the link was down.",
            lambda s: state(s).dropped,
        ),
        counter(
            f"{prefix}handler_failures_total",
            "MQTT messages whose handler failed. This is a bug of the program; please report it.",
            lambda s: state(s).handler_failures,
        ),
        gauge(
            f"{prefix}subscriptions_refused",
            "Subscriptions refused by the broker's access list.",
            lambda s: len(state(s).refused),
        ),
        gauge(
            f"{prefix}topics_set_aside",
            "Topics on which nothing is sent for 10 minutes, because the broker ends the connection at it.",
            lambda s: len(state(s).set_aside),
        ),
    )


def certificate_metrics(certificates: Callable[[S], Certificates]) -> tuple[Metric[S], ...]:
    """Return the metrics of a program's certificates."""
    return (
        gauge(
            "nena_certificate_expiry_timestamp_seconds",
            "End of validity of the certificates that the program uses, Unix time: `http` "
            "(`http.tls_certificate`, as the server presents it: a renewed file counts within seconds) and "
            "`mqtt` (`mqtt.tls.certificate`, whose renewed file counts at once).",
            lambda s: {name: each.end.timestamp() for name, each in certificates(s).validity().items()},
            "certificate",
        ),
        gauge(
            "nena_certificate_lifetime_seconds",
            "Time from the start to the end of validity of these certificates.",
            lambda s: {name: each.lifetime for name, each in certificates(s).validity().items()},
            "certificate",
        ),
    )
