"""Path locks set by hosts, which override the plant model and are kept in the store, and those of stops."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from itertools import islice
from typing import Final

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import UnknownError
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.plant import PathLockPreview, PathStatus
from nena_shared.fleet_api.refusals import Refusal
from nena_shared.fleet_api.requests import SOMEBODY
from nena_shared.fleet_api.stops import SetBy
from nena_shared.log import get_logger
from nena_shared.plant import Path, UnknownObjectError, Vehicle

log = get_logger(__name__)

LOCKED_BY: Final = "lockedBy"
"""Kind of the documents with who has locked a path."""

PREVIEWED: Final = 300
"""Orders in the queue that a preview checks: each may need route searches of milliseconds."""


class PathLocks:
    """Applies path locks to new routes, and to driving vehicles beyond their bases."""

    def __init__(self, engine: Engine) -> None:
        """Start with the locks of the plant model."""
        self._engine = engine
        self._plant = engine.plant
        self._locked_paths = engine.context.locked_paths

    async def load(self) -> None:
        """Restore the locks from before a restart, for paths that still exist."""
        stored = await self._engine.store.read_path_locks()
        locks = {name: locked for name, locked in stored.items() if name in self._plant.paths_by_name}
        if locks:
            stored_by = await self._engine.store.documents(LOCKED_BY)
            self._locked_paths.locked_by = {
                name: SetBy.model_validate_json(stored_by[name]) for name in locks if name in stored_by
            }
            self._locked_paths.lock(by_hosts=locks)

    def all(self) -> tuple[PathStatus, ...]:
        """Return all paths."""
        return tuple(map(self._status_of, self._plant.paths))

    def get(self, name: str) -> PathStatus:
        """Return a path; raises UnknownError."""
        return self._status_of(self._existing_path(name))

    async def set(self, name: str, *, locked: bool, by: str = SOMEBODY) -> PathStatus:
        """Lock or unlock a path for ``by``; the change is committed on return.

        Raises:
            UnknownError: no such path.
            StoreNotReadyError: the change may be lost.
        """
        path = self._existing_path(name)
        changes = Changes()
        changes.path_locks[name] = locked
        known = self._locked_paths.locked_by
        # The first one stays: whoever locks it again has not closed it.
        setter = known.get(name, SetBy(by=by, since=self._engine.clock.now())) if locked else None
        changes.documents[LOCKED_BY, name] = setter.model_dump_json() if setter else None

        def apply_committed() -> None:
            if setter:
                known[name] = setter
            else:
                known.pop(name, None)
            log.info("path locked" if locked else "path unlocked", path=name)
            self._locked_paths.lock(by_hosts={**self._locked_paths.by_hosts, name: locked})
            if not self._engine.unit_of_work.closed:  # otherwise the new engine loads it from the store
                self._engine.plant_changed()

        await self._engine.unit_of_work.commit(changes, apply_committed)
        return self._status_of(path)

    def preview(self, names: Sequence[str]) -> PathLockPreview:
        """Return what locks of these paths would leave without a route; raises UnknownError."""
        avoid = frozenset(self._existing_path(name).name for name in names)
        engine, stranded = self._engine, dict[str, str]()
        places = {
            vehicle.name: held[-1].point
            for vehicle in engine.registry
            if (held := engine.traffic.held_by(vehicle.name))
        }
        for vehicle in engine.registry:
            order, place = engine.state.order_of(vehicle.key), places.get(vehicle.name)
            if order and place and self._closes(avoid, order, (place,), vehicle.model):
                stranded[vehicle.name] = order.name
        starts = frozenset(places.values())
        waiting = islice(engine.state.orders.dispatchable(), PREVIEWED)
        closed = (order.name for order in waiting if self._closes(avoid, order, starts))
        return PathLockPreview(vehicles=tuple(stranded), orders=(*stranded.values(), *closed))

    def _closes(
        self,
        avoid: frozenset[str],
        order: TransportOrder,
        starts: Collection[str],
        model: Vehicle | None = None,
    ) -> bool:
        """Return whether all routes of an order from these points lead over paths to ``avoid``."""

        def has_route(avoid: frozenset[str]) -> bool:
            destinations = [each.destination for each in order.status.drive_orders[order.index :]]
            for start in starts:
                with suppress(NoRouteError, UnknownObjectError):
                    self._engine.context.finder.find(start, destinations, vehicle=model, avoid=avoid)
                    return True
            return False

        return has_route(order.resources_to_avoid) and not has_route(order.resources_to_avoid | avoid)

    def _existing_path(self, name: str) -> Path:
        path = self._plant.paths_by_name.get(name)
        if path is None:
            raise UnknownError(Refusal.UNKNOWN_PATH, name)
        return path

    def _status_of(self, path: Path) -> PathStatus:
        stop = self._locked_paths.by_stops.get(path.name)
        return PathStatus(
            name=path.name,
            source_point=path.source,
            destination_point=path.destination,
            locked=stop is not None or self._locked_paths.by_hosts.get(path.name, path.locked),
            locked_in_plant_model=path.locked,
            stop=stop,
            locked_by=self._locked_paths.locked_by.get(path.name),
        )
