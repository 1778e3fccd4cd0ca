"""Requests of hosts about stops; changes are committed before the answer."""

from __future__ import annotations

from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.stops import StopEndRequest, StopRequest, StopStatus


class StopRequests:
    """Begins and ends stops of all robots or of areas; see :mod:`nena_order_service.engine.stops`."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    async def load(self) -> None:
        """Restore the stops from before a restart."""
        await self._engine.load_stops()

    def all(self) -> tuple[StopStatus, ...]:
        """Return the active stops, the oldest first."""
        return self._engine.stops.statuses()

    async def begin(self, request: StopRequest, caller: str) -> StopStatus:
        """Pause all robots, or those in an area.

        Raises:
            TooManyStopsError: no more stops can be active.
            StoreNotReadyError: the stop may be lost.

        """
        self._engine.unit_of_work.require_store()
        stop = self._engine.stop(request, request.by or caller)
        await self._engine.unit_of_work.wait_committed()
        return self._engine.stops.status(stop)

    async def end(self, name: str, request: StopEndRequest, caller: str) -> StopStatus:
        """End a stop.

        Raises:
            UnknownStopError: no active stop has this name.
            StoreNotReadyError: the change may be lost.

        """
        self._engine.stops.get(name)
        self._engine.unit_of_work.require_store()
        stop = self._engine.end_stop(name, request.by or caller, request.reason)
        await self._engine.unit_of_work.wait_committed()
        return StopStatus(
            name=name,
            by=stop.by,
            reason=stop.reason,
            since=stop.since,
            area=stop.area,
            ended=self._engine.context.clock.now(),
        )
