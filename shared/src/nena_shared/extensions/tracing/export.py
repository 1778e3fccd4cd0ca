"""Send spans to a collector with the OpenTelemetry SDK, in a thread of its own.

The queue is bounded: while the collector is unreachable or slow, new spans are dropped and counted. Nothing
waits for the collector, except the end of the program, for :data:`CLOSE_TIMEOUT`.
"""

from __future__ import annotations

import asyncio
import logging
import re
import ssl
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
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

from nena_shared.extensions.tracing import Span, TracingSettings
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError

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


class _ChosenIds(IdGenerator):
    """Returns the IDs of the span that is created next."""

    trace_id = span_id = 0

    def generate_trace_id(self) -> int:
        return self.trace_id

    def generate_span_id(self) -> int:
        return self.span_id


class _Ended(SpanProcessor):
    """Collects the SDK's spans, without those that are not sampled."""

    def __init__(self) -> None:
        self.spans: list[ReadableSpan] = []

    def on_end(self, span: ReadableSpan) -> None:
        self.spans.append(span)


class _Reason(logging.Handler):
    """Keeps the first message about an export, which names the cause; the last one may only say "timeout"."""

    text = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.text = self.text or re.sub(r"\?\S+", "?...", record.getMessage())  # queries may be secret


class SpanExport:
    """A bounded queue of spans, and the thread that exports them; only this thread uses the SDK."""

    def __init__(
        self, settings: TracingSettings, service: str, version: str, exporter: SpanExporter | None = None
    ) -> None:
        """Prepare the export; its thread starts with the first span.

        ``exporter`` replaces the one to ``tracing.endpoint``, for tests.

        Raises:
            ConfigurationError: ``tracing.ca`` cannot be read or is not PEM.
        """
        if settings.ca:
            _check_ca(settings.ca)
        self._reason = _Reason()
        self._exporter = exporter or OTLPSpanExporter(
            endpoint=str(settings.endpoint),
            certificate_file=str(settings.ca) if settings.ca else None,
            timeout=EXPORT_TIMEOUT,
            compression=Compression.Gzip,
        )
        self._ids, self._ended = _ChosenIds(), _Ended()
        provider = TracerProvider(
            # 0060: by the trace ID, so that both sides choose the same orders
            sampler=TraceIdRatioBased(settings.sample_ratio),
            resource=Resource.create({"service.name": service, "service.version": version}),
            id_generator=self._ids,
            shutdown_on_exit=False,
        )
        provider.add_span_processor(self._ended)
        self._tracer = provider.get_tracer("nena", version)
        self._outcomes = {"exported": 0, "failed": 0, "dropped": 0}
        self._waiting: deque[Span] = deque()
        self._wake, self._closed = threading.Event(), threading.Event()
        self._works = True
        self._thread: threading.Thread | None = None

    def __call__(self, span: Span) -> None:
        """Add a span to the queue; drop it if the queue is full."""
        if len(self._waiting) >= QUEUE_LIMIT or self._closed.is_set():
            self._outcomes["dropped"] += 1
            return
        self._waiting.append(span)
        self._wake.set()
        if self._thread is None:
            self._thread = self._start_thread()

    @property
    def outcomes(self) -> Mapping[str, int]:
        """Number of spans by outcome."""
        return dict(self._outcomes)

    async def close(self) -> None:
        """Export the waiting spans, for at most :data:`CLOSE_TIMEOUT`."""
        self._closed.set()
        self._wake.set()
        if self._thread:
            await asyncio.to_thread(self._thread.join, CLOSE_TIMEOUT)
        self._exporter.shutdown()

    def _start_thread(self) -> threading.Thread:
        """Start the thread; from now on, failed attempts of the SDK are not logged one by one."""
        logging.getLogger("opentelemetry").setLevel(logging.CRITICAL)
        attempts = logging.getLogger("opentelemetry.exporter")
        attempts.setLevel(logging.WARNING)
        attempts.propagate = False
        attempts.addHandler(self._reason)
        # 0060: a daemon, which cannot delay the end of the program beyond `CLOSE_TIMEOUT`
        thread = threading.Thread(target=self._export_batches, name="span export", daemon=True)
        thread.start()
        return thread

    def _export_batches(self) -> None:
        while not self._closed.is_set():
            self._wake.wait()
            self._closed.wait(BATCH_DELAY)
            # before the queue is emptied: a span that comes meanwhile wakes the thread again
            self._wake.clear()
            self._export_all()
        self._export_all()  # what was added between the last export and the end

    def _export_all(self) -> None:
        while self._waiting:
            batch = [self._waiting.popleft() for _ in range(min(BATCH, len(self._waiting)))]
            self._log_change(self._export_batch(batch))

    def _export_batch(self, batch: Sequence[Span]) -> bool:
        """Return whether the collector has accepted a batch."""
        self._ended.spans, self._reason.text = [], ""
        try:
            for span in batch:
                self._convert_span(span)
            made = self._ended.spans
            works = not made or self._exporter.export(made) is SpanExportResult.SUCCESS
        except Exception:
            # any error of the SDK: it would end the thread, and with it the export
            log.exception("spans cannot be converted")
            works = False
        self._outcomes["exported" if works else "failed"] += len(self._ended.spans)
        return works

    def _log_change(self, works: bool) -> None:  # noqa: FBT001 - of one batch
        """Log when the collector stops accepting spans, and when it accepts them again."""
        if works is not self._works:
            self._works = works
            if works:
                log.info("traces are exported again")
            else:
                log.warning(
                    "traces cannot be exported; check tracing.endpoint and the collector",
                    reason=self._reason.text,
                )

    def _convert_span(self, span: Span) -> None:
        self._ids.trace_id, self._ids.span_id = span.trace_id, span.span_id
        made = self._tracer.start_span(
            span.name,
            context=_span_context_of(span.trace_id, span.parent_id) if span.parent_id else Context(),
            attributes=span.attributes,
            links=[trace.Link(_span_context(span.link.trace_id, span.link.span_id))] if span.link else (),
            start_time=_nanoseconds(span.begin),
        )
        for event in span.events:
            made.add_event(event.name, event.attributes, _nanoseconds(event.time))
        if span.error:
            made.set_status(trace.StatusCode.ERROR, span.error)
        # a clock that was set back between them must not make the span negative
        made.end(_nanoseconds(max(span.begin, span.end)))


def _check_ca(file: Path) -> None:
    try:
        ssl.create_default_context(cafile=file)
    except (OSError, ssl.SSLError) as error:
        raise ConfigurationError([f"tracing.ca: {file}: {error.strerror or error}"]) from error


def _span_context_of(trace_id: int, span_id: int) -> Context:
    return trace.set_span_in_context(trace.NonRecordingSpan(_span_context(trace_id, span_id)), Context())


def _span_context(trace_id: int, span_id: int) -> trace.SpanContext:
    sampled = trace.TraceFlags(trace.TraceFlags.SAMPLED)
    return trace.SpanContext(trace_id, span_id, is_remote=True, trace_flags=sampled)


def _nanoseconds(moment: datetime) -> int:
    # by microseconds: a float does not hold nanoseconds since 1970 exactly
    return round(moment.timestamp() * 1e6) * 1000
