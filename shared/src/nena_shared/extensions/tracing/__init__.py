"""Traces of orders: the IDs that both sides derive from a VDA 5050 orderId, spans, and their settings.

Spans are plain data of ended work. :mod:`~nena_shared.extensions.tracing.export`, which needs the extra
``tracing``, is imported only if ``tracing.endpoint`` is set.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from secrets import randbits
from typing import Final, Protocol, Self

from pydantic import Field, HttpUrl

from nena_shared.settings import ConfigurationError, SettingsGroup

SPAN_ID_BITS: Final = 64
EVENTS_LIMIT: Final = 100
"""Maximum number of events of a span; later ones are left out."""
TEXT_LIMIT: Final = 500
"""Maximum length of a text in a span, characters."""

SPANS_HELP: Final = (
    "Spans of traces by outcome: `exported`, `failed` (the collector did not accept them), `dropped` (the "
    "queue was full). Absent without tracing.endpoint."
)

_DRIVE_ORDER: Final = re.compile(r"-\d+(~\d+)?\Z")
"""The end of the orderIds of NeNa's order service: the index of the drive order, and of the attempt."""


class TracingSettings(SettingsGroup):
    """Traces of orders, sent to an OpenTelemetry collector."""

    endpoint: HttpUrl | None = Field(
        None,
        description="URL of the collector's traces (OTLP over HTTP), such as "
        "http://127.0.0.1:4318/v1/traces. Unset: no traces.",
    )
    sample_ratio: float = Field(
        1.0,
        ge=0,
        le=1,
        description="Share of orders that are traced. Order service and edge agents need the same value.",
    )
    ca: Path | None = Field(
        None, description="CA bundle (PEM) for the collector. Unset: the public CAs of the package certifi."
    )


@dataclass(frozen=True, slots=True)
class TraceContext:
    """The trace and the span of a caller."""

    trace_id: int
    span_id: int

    @classmethod
    def of(cls, traceparent: str | None) -> Self | None:
        """Read a ``traceparent`` of version 00; return None without one, or if an ID is 0."""
        if traceparent is None:
            return None
        trace_id, span_id = (int(each, 16) for each in traceparent.split("-")[1:3])
        # W3C Trace Context, 3.2.2: IDs of zeros only are invalid
        return cls(trace_id, span_id) if trace_id and span_id else None


def order_name_of(order_id: str) -> str:
    """Return the transport order of a VDA order that NeNa's order service has sent."""
    return _DRIVE_ORDER.sub("", order_id)


def trace_id_of(name: str) -> int:
    """Return the ID of the trace of a transport order, or of an order of another fleet control."""
    return _derive_id("trace", name, 16)


def order_span_id(name: str) -> int:
    """Return the ID of the span of a transport order."""
    return _derive_id("transportOrder", name, 8)


def vda_order_span_id(order_id: str) -> int:
    """Return the ID of the span of a VDA order, whose children are the robot's spans."""
    return _derive_id("vdaOrder", order_id, 8)


def _derive_id(kind: str, name: str, length: int) -> int:
    # 0060: order service and agent may be of different releases, so this text never changes
    return int.from_bytes(sha256(f"nena:{kind}:{name}".encode()).digest()[:length], "big")


def new_span_id() -> int:
    """Return a random ID."""
    return randbits(SPAN_ID_BITS) or 1


AttributeValue = str | int | float | bool


@dataclass(frozen=True, slots=True)
class SpanEvent:
    """Something that happened during a span."""

    name: str
    time: datetime
    attributes: Mapping[str, AttributeValue] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Span:
    """Work that has ended. ``error`` is why it failed; empty: it did not."""

    name: str
    trace_id: int
    span_id: int
    parent_id: int | None
    begin: datetime
    end: datetime
    attributes: Mapping[str, AttributeValue] = field(default_factory=dict)
    events: tuple[SpanEvent, ...] = ()
    link: TraceContext | None = None
    """The caller in another trace."""
    error: str = ""


Export = Callable[[Span], None]
"""Takes a span at once, without waiting for the collector."""


class Exporting(Protocol):
    """The connection to the collector."""

    def __call__(self, span: Span) -> None:
        """Take a span; see :data:`Export`."""
        ...

    @property
    def outcomes(self) -> Mapping[str, int]:
        """Number of spans by outcome: exported, failed, dropped."""
        ...

    async def close(self) -> None:
        """Export the last spans, within a limited time."""
        ...


def open_export(settings: TracingSettings, distribution: str) -> Exporting | None:
    """Return the connection to the collector; None if traces are off, and nothing is loaded.

    Raises:
        ConfigurationError: the extra ``tracing`` of the distribution is not installed.
    """
    if settings.endpoint is None:
        return None
    try:
        from nena_shared.extensions.tracing.export import SpanExport  # noqa: PLC0415 - an extra
    except ImportError as error:
        problem = f"tracing.endpoint: {error}; install the extra {distribution}[tracing]"
        raise ConfigurationError([problem]) from error
    return SpanExport(settings, distribution, version(distribution))


def cut(text: str) -> str:
    """Return a text of a robot or host, cut to :data:`TEXT_LIMIT`."""
    return text[:TEXT_LIMIT]
