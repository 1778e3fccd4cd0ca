"""Send spans to a collector with the OpenTelemetry SDK, in a thread of its own.

The queue is bounded: while the collector is unreachable or slow, new spans are dropped and counted. Nothing
waits for the collector, except the end of the program, for :data:`CLOSE_TIMEOUT`.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Final

from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.exporter.otlp.proto.http import Compression
from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
from opentelemetry.sdk.resources import Resource
from opentelemetry.sdk.trace import ReadableSpan, SpanProcessor, TracerProvider
from opentelemetry.sdk.trace.export import SpanExporter, SpanExportResult
from opentelemetry.sdk.trace.id_generator import IdGenerator
from opentelemetry.sdk.trace.sampling import TraceIdRatioBased

from nena_shared.log import get_logger
from nena_shared.tracing import Span, TracingSettings

log = get_logger(__name__)

QUEUE_LIMIT: Final = 4096
"""Maximum number of spans that wait for the collector."""
BATCH: Final = 512
BATCH_DELAY: Final = 1.0
"""Seconds between a span and its export, during which others may join it."""
EXPORT_TIMEOUT: Final = 5.0
"""Timeout of an export with its retries, seconds."""
CLOSE_TIMEOUT: Final = 2.0
"""Timeout for the last spans at the end of the program, seconds."""


class SpanQueue(SpanProcessor):
    """A bounded queue, and the thread that exports its spans."""

    def __init__(self, exporter: SpanExporter) -> None:
        self.exported = self.failed = self.dropped = 0
        self._exporter = exporter
        self._waiting: deque[ReadableSpan] = deque()
        self._wake, self._closed = threading.Event(), threading.Event()
        self._works = True
        self._thread = threading.Thread(target=self._run, name="span export", daemon=True)
        self._thread.start()

    def on_end(self, span: ReadableSpan) -> None:
        """Add an ended span; drop it if the queue is full."""
        if len(self._waiting) >= QUEUE_LIMIT or self._closed.is_set():
            self.dropped += 1
            return
        self._waiting.append(span)
        self._wake.set()

    def close(self, timeout: float) -> None:
        """Export the waiting spans, but for no longer than ``timeout`` s."""
        self._closed.set()
        self._wake.set()
        self._thread.join(timeout)
        self._exporter.shutdown()

    def _run(self) -> None:
        while not self._closed.is_set():
            self._wake.wait()
            self._closed.wait(BATCH_DELAY)
            self._wake.clear()
            self._export_all()
        self._export_all()  # what was added between the last export and the end

    def _export_all(self) -> None:
        while self._waiting:
            self._export([self._waiting.popleft() for _ in range(min(BATCH, len(self._waiting)))])

    def _export(self, batch: Sequence[ReadableSpan]) -> None:
        try:
            works = self._exporter.export(batch) is SpanExportResult.SUCCESS
        except Exception:
            log.exception("spans cannot be encoded")
            works = False
        if works:
            self.exported += len(batch)
        else:
            self.failed += len(batch)
        if works is not self._works:
            self._works = works
            if works:
                log.info("traces are exported again")
            else:
                log.warning("traces cannot be exported; check tracing.endpoint and the collector")


class _ChosenIds(IdGenerator):
    """Returns the IDs of the span that is created next."""

    trace_id = span_id = 0

    def generate_trace_id(self) -> int:
        return self.trace_id

    def generate_span_id(self) -> int:
        return self.span_id


class SpanExport:
    """Takes spans in the event loop's thread, and exports them."""

    def __init__(
        self, settings: TracingSettings, service: str, version: str, exporter: SpanExporter | None = None
    ) -> None:
        """``exporter`` replaces the one to ``tracing.endpoint``, for tests."""
        logging.getLogger("opentelemetry").setLevel(logging.CRITICAL)  # it logs each failed attempt
        exporter = exporter or OTLPSpanExporter(
            endpoint=str(settings.endpoint),
            certificate_file=str(settings.ca) if settings.ca else None,
            timeout=EXPORT_TIMEOUT,
            compression=Compression.Gzip,
        )
        self._ids, self._queue = _ChosenIds(), SpanQueue(exporter)
        provider = TracerProvider(
            sampler=TraceIdRatioBased(settings.sample_ratio),
            resource=Resource.create({"service.name": service, "service.version": version}),
            id_generator=self._ids,
            shutdown_on_exit=False,
        )
        provider.add_span_processor(self._queue)
        self._tracer = provider.get_tracer("nena", version)

    def __call__(self, span: Span) -> None:
        """Queue a span."""
        self._ids.trace_id, self._ids.span_id = span.trace_id, span.span_id
        made = self._tracer.start_span(
            span.name,
            context=_context(span.trace_id, span.parent_id) if span.parent_id else Context(),
            attributes=span.attributes,
            links=[trace.Link(_span_context(span.link.trace_id, span.link.span_id))] if span.link else (),
            start_time=_nanoseconds(span.begin),
        )
        for event in span.events:
            made.add_event(event.name, event.attributes, _nanoseconds(event.time))
        if span.error:
            made.set_status(trace.StatusCode.ERROR, span.error)
        made.end(_nanoseconds(max(span.begin, span.end)))

    @property
    def outcomes(self) -> Mapping[str, int]:
        """Number of spans by outcome."""
        queue = self._queue
        return {"exported": queue.exported, "failed": queue.failed, "dropped": queue.dropped}

    async def close(self) -> None:
        """Export the last spans."""
        await asyncio.to_thread(self._queue.close, CLOSE_TIMEOUT)


def _context(trace_id: int, span_id: int) -> Context:
    return trace.set_span_in_context(trace.NonRecordingSpan(_span_context(trace_id, span_id)), Context())


def _span_context(trace_id: int, span_id: int) -> trace.SpanContext:
    sampled = trace.TraceFlags(trace.TraceFlags.SAMPLED)
    return trace.SpanContext(trace_id, span_id, is_remote=True, trace_flags=sampled)


def _nanoseconds(moment: datetime) -> int:
    return round(moment.timestamp() * 1e6) * 1000
