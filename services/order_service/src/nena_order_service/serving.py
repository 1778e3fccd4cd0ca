"""The order service over one store: runs its parts, and takes all up anew when the plant model is changed."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from starlette.types import ASGIApp

from nena_order_service.errors import InvalidPlantError, PlantInUseError, StoreNotReadyError
from nena_order_service.kernel.kernel import Kernel
from nena_order_service.kernel.plant_change import hindrances
from nena_order_service.plant_file import PlantFile
from nena_order_service.store.changes import Changes
from nena_order_service.store.store import Store
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import Supervisor, end

log = get_logger(__name__)

KIND = "plantModel"
CHANGING = "the plant model is being changed; ask again in a moment"
PATIENCE = 20.0
"""Seconds in which a host is told that its plant model is in use; it is put in use later, too."""


class Parts(Protocol):
    """All parts of the order service over one plant model."""

    kernel: Kernel

    @property
    def app(self) -> ASGIApp:
        """The REST door."""
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
class _Asked:
    model: PlantModel
    done: asyncio.Future[None]
    check_only: bool


P = TypeVar("P", bound=Parts)


class Serving(Generic[P]):
    """Runs an order service; its plant model is that of the file until a host puts another one.

    What a host has put counts until the file changes, and is forgotten then. A change is checked and
    committed between two steps of the kernel; then everything is made anew over the same store, as after a
    restart: robots go on with what they have, and orders where these are.
    """

    def __init__(
        self,
        file: PlantFile,
        store: Store,
        supervisor: Supervisor,
        *,
        make: Callable[[PlantModel], P],
    ) -> None:
        """Serve the model of ``file``, or what replaces it, by the parts that ``make`` makes."""
        self.show: Callable[[ASGIApp], None] = lambda _: None
        """Is given the REST door whenever it is made anew."""
        self.parts: P
        self._file = file
        self._store = store
        self._supervisor = supervisor
        self._make = make
        self._tasks: list[asyncio.Task[None]] = []
        self._asked: asyncio.Queue[_Asked] = asyncio.Queue(maxsize=1)

    async def begin(self) -> None:
        """Let all parts run.

        Raises:
            ConfigurationError: the plant model names a version that is not spoken here.

        """
        self._supervisor.start("store", self._store.run())
        self.parts = self._make(await self._present())
        await self.parts.begin(self._start)
        self._supervisor.start("plant model", self._change_when_asked())

    async def change_plant(self, model: PlantModel, *, check_only: bool = False) -> None:
        """Put another plant model in use, or only tell whether that can be.

        Raises:
            InvalidPlantError: it is none with which robots can be led here.
            PlantInUseError: orders or vehicles use what it does not have.
            StoreNotReadyError: it cannot be kept, or another change is under way.

        """
        asked = _Asked(model, asyncio.get_running_loop().create_future(), check_only)
        try:
            self._asked.put_nowait(asked)
            async with asyncio.timeout(PATIENCE):
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

    async def _change(self, asked: _Asked) -> None:
        try:
            parts = await asyncio.to_thread(self._make, asked.model)
        except ConfigurationError as error:
            raise InvalidPlantError(error.problems) from error
        old = self.parts
        if problems := hindrances(old.kernel, asked.model, parts.kernel.registry):
            raise PlantInUseError(problems)
        if not self._store.ready:
            raise StoreNotReadyError(self._store.why_not_ready)
        if asked.check_only:
            return
        old.kernel.close(CHANGING)  # from here to the check above nothing else has run
        await self._end(old)
        await self._keep(asked.model)
        self.parts = parts
        try:
            await parts.begin(self._start)
        except StoreNotReadyError as error:  # no answer to a host: nothing runs any more, so the program ends
            message = "the plant was changed and cannot be taken up: the store takes nothing"
            raise RuntimeError(message) from error
        self.show(parts.app)
        log.info("plant model changed", name=asked.model.name, points=len(asked.model.points))

    async def _end(self, parts: Parts) -> None:
        tasks, self._tasks = self._tasks, []
        await end(*tasks)
        await parts.end()

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
        """Give the model that a host has put here, unless the file has changed since."""
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
"""As :meth:`Serving.change_plant`."""
