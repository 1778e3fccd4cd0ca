"""All that ``/metrics`` says."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator

from prometheus_client import CollectorRegistry, GCCollector, ProcessCollector, generate_latest

from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.metrics.fleet_collector import FleetCollector
from nena_status_aggregator.metrics.robot_series import RobotSeries


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
