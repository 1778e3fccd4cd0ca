"""Traces: a span for each order, goal and action of a robot, sent to an OpenTelemetry collector."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar

from nena_edge_agent.extension import Core, Extension, Robot
from nena_edge_agent.extensions.tracing.robot_tracer import RobotTracer
from nena_edge_agent.protocol.events import Effect, Event
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.extensions.tracing import SPANS_HELP, TracingSettings, open_export
from nena_shared.settings import SettingsGroup

if TYPE_CHECKING:
    from nena_shared.metrics import Section

DISTRIBUTION = "nena-edge-agent"


class Tracing(Extension):
    """Exports spans if ``tracing.endpoint`` is set."""

    Settings: ClassVar[type[SettingsGroup]] = TracingSettings

    def __init__(self, settings: TracingSettings, core: Core) -> None:
        super().__init__(settings, core)
        self.export = open_export(settings, DISTRIBUTION)
        self._tracers = (
            {robot.key: RobotTracer(robot.key, core.clock, self.export) for robot in core.robots}
            if self.export
            else {}
        )

    @classmethod
    def metrics(cls) -> Section[Tracing]:
        """Return the number of spans."""
        from nena_shared.metrics import Section, counter  # noqa: PLC0415 - an extra

        return Section(
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

    def on_event(self, robot: Robot, event: Event, effects: Iterable[Effect], state: RobotState) -> None:
        """Open and end spans."""
        if tracer := self._tracers.get(robot.key):
            tracer.handle_event(event, effects, state)

    def on_end(self, robot: Robot) -> None:
        """Export what has not ended; after a restart, the rest of it is another span."""
        if tracer := self._tracers.get(robot.key):
            tracer.close()

    async def close(self) -> None:
        """Export the last spans."""
        if self.export:
            await self.export.close()
