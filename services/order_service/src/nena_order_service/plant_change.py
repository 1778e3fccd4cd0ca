"""Changes of the plant model: what conflicts with one, and the runner that rebuilds the service for it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from starlette.types import ASGIApp

from nena_order_service.engine.engine import Engine
from nena_order_service.errors import InvalidPlantError, PlantInUseError, StoreNotReadyError
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.validation import InvalidRequestError, check_order
from nena_order_service.plant_file import PlantFile
from nena_order_service.store.changes import Changes
from nena_order_service.store.store import Store
from nena_order_service.traffic.resources import ResourceSet
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel
from nena_shared.plant.model import BlockType
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import Supervisor, end

PROBLEMS_NAMED = 100
"""Maximum number of conflicts that an answer lists."""


def conflicts(engine: Engine, new: PlantModel, registry: VehicleRegistry) -> tuple[str, ...]:
    """Return what of the present orders and vehicles conflicts with the plant model ``new``.

    ``registry`` is that of the new plant. Orders must find their destinations, and vehicles what they hold
    and have claimed, unchanged: robots drive on as they were sent, and other vehicles keep off.
    """
    found = [
        *_of_orders(engine.state.orders.present(), new, registry),
        *_of_sequences(engine.state.sequences.unfinished(), registry),
        *_of_vehicles(engine, new, registry),
    ]
    more = len(found) - PROBLEMS_NAMED
    return (*found[:PROBLEMS_NAMED], f"and {more} more") if more > 0 else tuple(found)


def _of_orders(orders: Iterable[TransportOrder], new: PlantModel, registry: VehicleRegistry) -> Iterator[str]:
    names = registry.names()
    for order in orders:
        left = order.status.drive_orders[max(order.status.current_drive_order_index, 0) :]
        try:
            check_order(order.status.model_copy(update={"drive_orders": left}), new)
        except InvalidRequestError as error:
            yield from (f"transport order {order.name!r}: {each.text}" for each in error.findings)
        intended = order.status.intended_vehicle
        if intended is not None and intended not in names:
            yield f"transport order {order.name!r} is for vehicle {intended!r}, which there would not be"


def _of_sequences(sequences: Iterable[OrderSequence], registry: VehicleRegistry) -> Iterator[str]:
    names = registry.names()
    for each in sequences:
        vehicle = each.bound_vehicle or each.status.intended_vehicle
        if vehicle is not None and vehicle not in names:
            yield f"order sequence {each.name!r} is for vehicle {vehicle!r}, which there would not be"


def _of_vehicles(engine: Engine, new: PlantModel, registry: VehicleRegistry) -> Iterator[str]:
    differences = _Differences(engine.plant, new)
    for vehicle in engine.registry:
        journey = engine.traffic.journey(vehicle.name)
        if engine.works(vehicle) or journey:
            yield from _of_robot(vehicle, registry)
        ahead = journey.way[journey.allocated :] if journey else ()
        for place in (*engine.traffic.held(vehicle.name), *ahead):
            for problem in differences.of(place, under_way=journey is not None):
                yield f"vehicle {vehicle.name!r} uses {problem}"


def _of_robot(vehicle: FleetVehicle, registry: VehicleRegistry) -> Iterator[str]:
    """Yield why a vehicle that works would not be the same one."""
    if vehicle.model is None:
        after, taken = registry.of(vehicle.key), registry.named(vehicle.name)
        if (after and after.name != vehicle.name) or (taken and taken.key != vehicle.key):
            yield f"vehicle {vehicle.name!r} works, and would have another name"
        return
    after = registry.named(vehicle.name)
    if after is None or after.model is None:
        yield f"vehicle {vehicle.name!r} works, and would be gone"
    elif after.key != vehicle.key or after.profile.map_id != vehicle.profile.map_id:
        yield f"vehicle {vehicle.name!r} works, and would be another robot or on another map"


class _Differences:
    """Compares what single resources are in two plants."""

    def __init__(self, old: PlantModel, new: PlantModel) -> None:
        self._old = old
        self._new = new
        self._old_blocks, self._new_blocks = _blocks(old), _blocks(new)

    def of(self, place: ResourceSet, *, under_way: bool) -> Iterator[str]:
        """Yield what of a place would be gone or different; of who is ``under_way`` also where it is."""
        for name in dict.fromkeys((place.point, *place.uses)):
            if name in self._old.blocks_by_name:
                continue
            if self._lacks(name):
                yield f"{name!r}, which would be gone"
            elif self._old_blocks.get(name) != self._new_blocks.get(name):
                yield f"{name!r}, which would be in other blocks"
            elif under_way and self._differs(name):
                yield f"{name!r}, which would be elsewhere"

    def _lacks(self, name: str) -> bool:
        kinds = (
            (self._old.points_by_name, self._new.points_by_name),
            (self._old.paths_by_name, self._new.paths_by_name),
            (self._old.locations_by_name, self._new.locations_by_name),
        )
        return any(name in old and name not in new for old, new in kinds)

    def _differs(self, name: str) -> bool:
        before, after = self._old.points_by_name.get(name), self._new.points_by_name.get(name)
        if before and after:
            return (before.x_mm, before.y_mm, before.map_id) != (after.x_mm, after.y_mm, after.map_id)
        path, changed = self._old.paths_by_name.get(name), self._new.paths_by_name.get(name)
        if path and changed:
            return (path.source, path.destination, path.length_mm) != (
                changed.source,
                changed.destination,
                changed.length_mm,
            )
        return False


def _blocks(plant: PlantModel) -> dict[str, set[tuple[str, BlockType]]]:
    """Return the blocks that each resource is in."""
    found: dict[str, set[tuple[str, BlockType]]] = {}
    for block in plant.blocks:
        for member in block.members:
            found.setdefault(member, set()).add((block.name, block.type))
    return found


log = get_logger(__name__)

KIND = "plantModel"
CHANGING = "the plant model is being changed; ask again in a moment"
CHANGE_TIMEOUT = 20.0
"""Seconds that a host waits for its change; after them it may still succeed."""


class RunnableService(Protocol):
    """An order service for one plant model."""

    engine: Engine

    @property
    def app(self) -> ASGIApp:
        """The REST API."""
        ...

    async def begin(self, start: Callable[..., asyncio.Task[None]]) -> None:
        """Take up what is in the store, then let all parts run; ``start`` starts their tasks."""
        ...

    async def end(self) -> None:
        """End all that clients wait for."""
        ...


class StoredPlant(BaseModel):
    """A plant model that a host has put here in place of that of the file."""

    model_config = ConfigDict(frozen=True)

    file: str
    """The digest of the file in place of which it counts."""
    model: str


@dataclass(slots=True)
class _RequestedChange:
    model: PlantModel
    done: asyncio.Future[None]
    check_only: bool


P = TypeVar("P", bound=RunnableService)


class ServiceRunner(Generic[P]):
    """Runs an order service with the plant model of the file, or with one that a host has put in its place.

    A host's model counts until the file changes. A change is checked and committed between two units of
    work; then the service is built again over the same store, as after a restart: robots continue what
    they have, and orders continue where they are.
    """

    def __init__(
        self,
        file: PlantFile,
        store: Store,
        supervisor: Supervisor,
        *,
        make: Callable[[PlantModel], P],
    ) -> None:
        """Run the service that ``make`` builds for the model of ``file``, or for what replaces it."""
        self.show: Callable[[ASGIApp], None] = lambda _: None
        """Receives the REST application each time it is built."""
        self.service: P
        self._file = file
        self._store = store
        self._supervisor = supervisor
        self._make = make
        self._tasks: list[asyncio.Task[None]] = []
        self._asked: asyncio.Queue[_RequestedChange] = asyncio.Queue(maxsize=1)

    async def begin(self) -> None:
        """Start all tasks of the service.

        Raises:
            ConfigurationError: the plant model names an unsupported version.

        """
        self._supervisor.start("store", self._store.run())
        self.service = self._make(await self._present())
        await self.service.begin(self._start)
        self._supervisor.start("plant model", self._change_when_asked())

    async def change_plant(self, model: PlantModel, *, check_only: bool = False) -> None:
        """Use another plant model, or only check whether that is possible.

        Raises:
            InvalidPlantError: this service cannot use it.
            PlantInUseError: orders or vehicles use what it does not have.
            StoreNotReadyError: it cannot be kept, or another change is under way.

        """
        asked = _RequestedChange(model, asyncio.get_running_loop().create_future(), check_only)
        try:
            self._asked.put_nowait(asked)
            async with asyncio.timeout(CHANGE_TIMEOUT):
                await asked.done
        except (asyncio.QueueFull, TimeoutError):
            raise StoreNotReadyError(CHANGING) from None

    async def _change_when_asked(self) -> None:
        while True:
            asked = await self._asked.get()
            try:
                await self._change(asked)
            except (InvalidPlantError, PlantInUseError, StoreNotReadyError) as error:
                if not asked.done.done():
                    asked.done.set_exception(error)
            else:
                if not asked.done.done():
                    asked.done.set_result(None)

    async def _change(self, asked: _RequestedChange) -> None:
        try:
            service = await asyncio.to_thread(self._make, asked.model)
        except ConfigurationError as error:
            raise InvalidPlantError(error.problems) from error
        old = self.service
        if problems := conflicts(old.engine, asked.model, service.engine.registry):
            raise PlantInUseError(problems)
        if not self._store.ready:
            raise StoreNotReadyError(self._store.why_not_ready)
        if asked.check_only:
            return
        old.engine.close(CHANGING)  # from here to the check above nothing else has run
        await self._end(old)
        await self._keep(asked.model)
        self.service = service
        try:
            await service.begin(self._start)
        except StoreNotReadyError as error:  # no answer to a host: nothing runs any more, so the program ends
            message = "the plant was changed and cannot be taken up: the store takes nothing"
            raise RuntimeError(message) from error
        self.show(service.app)
        log.info("plant model changed", name=asked.model.name, points=len(asked.model.points))

    async def _end(self, service: RunnableService) -> None:
        tasks, self._tasks = self._tasks, []
        await end(*tasks)
        await service.end()

    async def _keep(self, model: PlantModel) -> None:
        """Commit the model, however long the store takes."""
        stored = StoredPlant(file=self._file.digest, model=model.to_json())
        await self._commit(stored.model_dump_json())

    async def _commit(self, document: str | None) -> None:
        changes = Changes()
        changes.documents[KIND, ""] = document
        done = asyncio.Event()
        self._store.commit(changes, done.set)
        await done.wait()

    async def _present(self) -> PlantModel:
        """Return the model that a host has put here, unless the file has changed since."""
        document = (await self._store.documents(KIND)).get("")
        if document is None:
            return self._file.model
        try:
            stored = StoredPlant.model_validate_json(document)
            model = PlantModel.from_json(stored.model)
        except ValidationError:
            log.exception("the plant model in the store cannot be read; that of the file is taken")
            return self._file.model
        if stored.file != self._file.digest:
            log.warning("the file of the plant model has changed: it counts, and what a host had put is gone")
            await self._commit(None)
            return self._file.model
        return model

    def _start(self, name: str, work: Any, *, vital: bool = True) -> asyncio.Task[None]:  # noqa: ANN401 - a coroutine
        task = self._supervisor.start(name, work, vital=vital)
        self._tasks.append(task)
        return task


ChangePlant = Callable[..., Awaitable[None]]
"""As :meth:`ServiceRunner.change_plant`."""
