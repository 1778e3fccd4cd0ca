"""Stops of all robots or of areas: operations of hosts."""

from __future__ import annotations

from collections.abc import Iterator

from nena_order_service.api.operations import Handler
from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.operations import fleet as table
from nena_shared.fleet_api.stops import StopEndRequest, StopList, StopRequest, StopStatus


class StopOperations:
    """Executes requests about stops; see :mod:`nena_order_service.engine.stops`."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield Handler(table.LIST_STOPS, lambda: StopList(stops=self._engine.stops.statuses()))
        yield Handler(table.STOP, self.begin, {"by": "Anna", "reason": "oil on the floor"})
        yield Handler(table.END_STOP, self.end, {"by": "Ben", "reason": "cleaned"})

    async def begin(self, request: StopRequest, caller: str) -> StopStatus:
        """Pause all robots, or those in an area; raises RefusedError."""
        async with self._engine.unit_of_work.saved():
            stop = self._engine.begin_stop(request, request.by or caller)
        return self._engine.stops.status_of(stop)

    async def end(self, name: str, request: StopEndRequest, caller: str) -> StopStatus:
        """End a stop; raises UnknownError."""
        self._engine.stops.get(name)
        async with self._engine.unit_of_work.saved():
            stop = self._engine.end_stop(name, request.by or caller, request.reason)
        return stop.with_status(ended=self._engine.clock.now())
