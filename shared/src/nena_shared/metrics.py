"""Metrics of a program as a table: each stands once, with its help, its labels, and how it is read.

Values are read at a scrape from the state wherever they are there; only durations are counted where they
happen, in a :class:`Histogram`.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from typing import Any, Generic, TypeVar

from prometheus_client import CollectorRegistry, GCCollector, ProcessCollector, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily
from prometheus_client.metrics_core import Metric as Family
from prometheus_client.registry import Collector

from nena_shared.log import get_logger
from nena_shared.mqtt.link import LinkState

log = get_logger(__name__)

S = TypeVar("S")

SHORT = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)
"""Upper bounds of buckets for work of the program, seconds."""

ANSWERS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""For what a robot or a broker has to answer, seconds."""

LONG = (1.0, 5.0, 10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0, 7200.0, 14400.0)
"""For what robots do, seconds."""


class Histogram:
    """Durations by bucket."""

    __slots__ = ("bounds", "counts", "total")

    def __init__(self, bounds: Sequence[float]) -> None:
        """Count nothing yet; ``bounds`` are the upper bounds of the buckets, the last one is infinite."""
        self.bounds = bounds
        self.counts = [0] * (len(bounds) + 1)
        self.total = 0.0

    def observe(self, seconds: float) -> None:
        """Count a duration."""
        self.counts[bisect_left(self.bounds, seconds)] += 1
        self.total += seconds

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Count how long the block takes."""
        begun = time.perf_counter()
        try:
            yield
        finally:
            self.observe(time.perf_counter() - begun)

    def buckets(self) -> list[tuple[str, float]]:
        """Return the cumulative buckets, as the text format has them."""
        running, found = 0, []
        for bound, count in zip((*self.bounds, inf), self.counts, strict=True):
            running += count
            found.append(("+Inf" if bound == inf else str(bound), float(running)))
        return found


class MetricKind(StrEnum):
    """Types of Prometheus."""

    GAUGE = "gauge"
    COUNTER = "counter"
    HISTOGRAM = "histogram"


LabelValues = str | tuple[str, ...]
"""Of one label, or of several in their order."""

Reading = float | Histogram | Mapping[Any, float] | Mapping[Any, Histogram] | None
"""The value of a metric without labels, or the values by :data:`LabelValues`; None: none at present."""


@dataclass(frozen=True, slots=True)
class Metric(Generic[S]):
    """One metric of a program; ``S`` is what it is read from."""

    name: str
    """As in a query: counters end with ``_total``."""
    kind: MetricKind
    text: str
    """A sentence."""
    labels: tuple[str, ...]
    read: Callable[[S], Reading]

    def family(self, source: S) -> Family:
        """Read the metric."""
        reading = self.read(source)
        if reading is None:
            samples: Iterable[tuple[LabelValues, float | Histogram]] = ()
        elif isinstance(reading, Mapping):
            samples = reading.items()
        else:
            samples = [((), reading)]
        family = self._empty()
        for values, sample in samples:
            labels = (values,) if isinstance(values, str) else values
            if isinstance(family, HistogramMetricFamily):
                assert isinstance(sample, Histogram), self.name  # noqa: S101 - for the type
                family.add_metric(labels, sample.buckets(), sample.total)
            else:
                assert not isinstance(sample, Histogram), self.name  # noqa: S101 - for the type
                family.add_metric(labels, sample)
        return family

    def _empty(self) -> GaugeMetricFamily | CounterMetricFamily | HistogramMetricFamily:
        match self.kind:
            case MetricKind.GAUGE:
                return GaugeMetricFamily(self.name, self.text, labels=self.labels)
            case MetricKind.COUNTER:
                return CounterMetricFamily(self.name.removesuffix("_total"), self.text, labels=self.labels)
            case MetricKind.HISTOGRAM:
                return HistogramMetricFamily(self.name, self.text, labels=self.labels)


def gauge(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Describe a value that rises and falls."""
    return Metric(name, MetricKind.GAUGE, text, labels, read)


def counter(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Describe a count since the start of the program; its name ends with ``_total``."""
    return Metric(name, MetricKind.COUNTER, text, labels, read)


def histogram(name: str, text: str, read: Callable[[S], Reading], *labels: str) -> Metric[S]:
    """Describe durations in seconds."""
    return Metric(name, MetricKind.HISTOGRAM, text, labels, read)


@dataclass(frozen=True, slots=True)
class Section(Generic[S]):
    """Metrics that belong together, as ``docs/metrics.md`` shows them."""

    title: str
    metrics: tuple[Metric[S], ...]
    text: str = ""
    """What holds for all of them, such as the values of a label."""


class _Table(Collector):
    """Reads a table at each scrape."""

    def __init__(self, source: object, sections: Sequence[Section[Any]]) -> None:
        self._source = source
        self._metrics = [each for section in sections for each in section.metrics]

    def describe(self) -> Iterable[Family]:
        return ()

    def collect(self) -> Iterator[Family]:
        for each in self._metrics:
            try:
                yield each.family(self._source)
            except Exception:  # the others are shown: who looks for a fault needs them most
                log.exception("a metric could not be read", metric=each.name)


class Exposition:
    """Writes a table of metrics, and those of the process."""

    def __init__(self, source: object, sections: Sequence[Section[Any]], *, process: bool = True) -> None:
        """Read the metrics of ``sections`` from ``source``; without ``process``, only those."""
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
        counter(f"{prefix}connects_total", "Connections made to the broker.", lambda s: state(s).connects),
        counter(f"{prefix}received_total", "MQTT messages received.", lambda s: state(s).received),
        counter(
            f"{prefix}published_total", "MQTT messages that the broker has.", lambda s: state(s).published
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
            "Subscriptions that the broker refuses by its access list.",
            lambda s: len(state(s).refused),
        ),
    )
