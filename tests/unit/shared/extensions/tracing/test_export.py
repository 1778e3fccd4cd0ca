"""The bounded queue of spans, and how they reach an exporter."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from opentelemetry.sdk.trace import ReadableSpan
from opentelemetry.sdk.trace.export import SpanExporter, SpanExportResult
from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter
from structlog.testing import capture_logs

from nena_shared.extensions.tracing import Span, SpanEvent, TraceContext, TracingSettings
from nena_shared.extensions.tracing import export as export_module
from nena_shared.extensions.tracing.export import SpanExport
from nena_shared.settings import ConfigurationError
from support.waiting import PATIENCE, until

BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
NANOSECONDS = 1_767_225_600_000_000_000
SETTINGS = TracingSettings.model_validate({"endpoint": "http://127.0.0.1:1/v1/traces"})
SPAN = Span(
    name="goal",
    trace_id=7,
    span_id=8,
    parent_id=9,
    begin=BEGIN,
    end=BEGIN + timedelta(seconds=2),
    attributes={"nena.outcome": "ABORTED"},
    events=(SpanEvent("nav2.goalAccepted", BEGIN + timedelta(seconds=1), {"vda5050.goal_id": "g"}),),
    link=TraceContext(5, 6),
    error="blocked",
)


class Stuck(SpanExporter):
    """An exporter that takes nothing until it is released."""

    def __init__(self) -> None:
        self.entered, self.released = threading.Event(), threading.Event()

    def export(self, _: Sequence[ReadableSpan]) -> SpanExportResult:
        self.entered.set()
        self.released.wait(PATIENCE)
        return SpanExportResult.FAILURE


@pytest.fixture(autouse=True)
def _without_delay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export_module, "BATCH_DELAY", 0.0)


def exporting(exporter: SpanExporter, ratio: float = 1.0) -> SpanExport:
    settings = SETTINGS.model_copy(update={"sample_ratio": ratio})
    return SpanExport(settings, "nena-edge-agent", "1.2", exporter)


async def test_a_span_is_exported_with_its_own_ids_and_times() -> None:
    memory = InMemorySpanExporter()
    export = exporting(memory)
    export(SPAN)
    await export.close()

    (made,) = memory.get_finished_spans()
    assert made.context
    assert made.parent
    assert (made.context.trace_id, made.context.span_id, made.parent.span_id) == (7, 8, 9)
    assert (made.start_time, made.end_time) == (NANOSECONDS, NANOSECONDS + 2_000_000_000)
    assert [(each.name, each.timestamp) for each in made.events] == [
        ("nav2.goalAccepted", NANOSECONDS + 1_000_000_000)
    ]
    assert [(each.context.trace_id, each.context.span_id) for each in made.links] == [(5, 6)]
    assert (made.status.is_ok, made.status.description) == (False, "blocked")
    assert made.resource.attributes["service.name"] == "nena-edge-agent"
    assert export.outcomes == {"exported": 1, "failed": 0, "dropped": 0}


async def test_both_sides_trace_the_same_orders() -> None:
    memory = InMemorySpanExporter()
    export = exporting(memory, 0.5)
    for trace_id in (1, 2**64 - 1):  # the lower 64 bits decide
        export(Span("order", trace_id, 8, None, BEGIN, BEGIN))
    await export.close()
    assert [each.context.trace_id for each in memory.get_finished_spans() if each.context] == [1]


async def test_a_stuck_collector_costs_spans_and_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(export_module, "QUEUE_LIMIT", 3)
    monkeypatch.setattr(export_module, "CLOSE_TIMEOUT", 0.05)
    stuck = Stuck()
    export = exporting(stuck)
    export(SPAN)
    await until(stuck.entered.is_set, what="the first export")
    for _ in range(5):
        export(SPAN)
    assert export.outcomes == {"exported": 0, "failed": 0, "dropped": 2}

    await export.close()
    export(SPAN)
    assert export.outcomes["dropped"] == 3
    stuck.released.set()
    await until(lambda: export.outcomes["failed"] == 4, what="the end of the thread")


class Refusing(BaseHTTPRequestHandler):
    """A collector that wants a login."""

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["content-length"]))
        self.send_response(401)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Log nothing."""


async def test_the_log_says_why_spans_are_not_exported_without_secrets_of_the_url() -> None:
    with HTTPServer(("127.0.0.1", 0), Refusing) as server, capture_logs() as logs:
        threading.Thread(target=server.handle_request, daemon=True).start()
        endpoint = f"http://127.0.0.1:{server.server_port}/v1/traces?key=secret"
        export = SpanExport(TracingSettings.model_validate({"endpoint": endpoint}), "nena", "1")
        export(SPAN)
        await until(lambda: export.outcomes["failed"] == 1, what="the failed export")
        await export.close()
    (warning,) = (each for each in logs if each["event"].startswith("traces cannot be exported"))
    assert "401" in warning["reason"]

    with capture_logs() as logs:
        export = SpanExport(TracingSettings.model_validate({"endpoint": endpoint}), "nena", "1")
        export(SPAN)
        await export.close()
        await until(lambda: export.outcomes["failed"] == 1, what="the refused connection")
        await until(lambda: bool(logs), what="the log line")
    assert "refused" in logs[0]["reason"]
    assert "secret" not in str(logs)


@pytest.mark.parametrize("content", [None, "not PEM"])
def test_an_unusable_ca_is_named_at_the_start(tmp_path: Path, content: str | None) -> None:
    ca = tmp_path / "ca.pem"
    if content:
        ca.write_text(content)
    settings = SETTINGS.model_copy(update={"ca": ca})
    with pytest.raises(ConfigurationError, match=r"tracing\.ca: .*ca\.pem: "):
        SpanExport(settings, "nena", "1")
