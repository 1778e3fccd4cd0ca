"""Traces of orders, sent to an OpenTelemetry collector."""

from __future__ import annotations

from typing import ClassVar, Final

from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.tracing.tracer import OrderTracer
from nena_order_service.fleet.outputs import FleetOutput, Publish
from nena_shared.extensions.tracing import SPANS_HELP, TracingSettings, open_export
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.metrics import Section, counter
from nena_shared.vda5050.topics import Topic

DISTRIBUTION: Final = "nena-order-service"


class Tracing(Extension):
    """Traces orders if ``tracing.endpoint`` is set."""

    Settings = TracingSettings

    def __init__(self, settings: TracingSettings, core: Core) -> None:
        """Prepare the export; it opens nothing before the first span."""
        super().__init__(settings, core)
        self.export = open_export(settings, DISTRIBUTION)
        self.tracer: OrderTracer | None = None

    @classmethod
    def check(cls, settings: TracingSettings) -> None:
        """Check that the libraries are installed, and that the CA can be read."""
        open_export(settings, DISTRIBUTION)

    async def begin(self, previous: Tracing | None) -> None:
        """Trace with the same connection to the collector as before."""
        if previous:
            self.export = previous.export
        if self.export:
            self.tracer = OrderTracer(self.core.engine.state.orders.named, self.core.clock, self.export)

    async def close(self) -> None:
        """Export the last spans, within a limited time."""
        if self.export:
            await self.export.close()

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Export what has ended."""
        if self.tracer:
            self.tracer.order_changed(status)

    def begun(self, order_id: str, now: float, *, restored: bool) -> None:  # noqa: ARG002 - monotonic
        """Export the planning of a VDA order."""
        if self.tracer:
            self.tracer.begun(order_id, restored=restored)

    def published(self, topic: Topic, output: Publish, now: float) -> None:  # noqa: ARG002
        """Note that a VDA order was sent."""
        if self.tracer:
            self.tracer.published(output)

    def happened(self, event: FleetOutput, now: float) -> None:  # noqa: ARG002
        """Note an event of a VDA order, and export it once it has ended."""
        if self.tracer:
            self.tracer.happened(event)

    section: ClassVar[Section[Tracing]] = Section(
        "Traces",
        (
            counter(
                "nena_trace_spans_total",
                SPANS_HELP,
                lambda s: s.export.outcomes if s.export else None,
                "outcome",
            ),
        ),
    )
