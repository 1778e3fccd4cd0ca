"""Run an order service, and rebuild it for another plant model or after an internal error."""

from __future__ import annotations

import asyncio
import gc
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

from pydantic import ValidationError
from starlette.types import ASGIApp

from nena_order_service.api.audit import current_recorder
from nena_order_service.engine.plant_change import conflicts
from nena_order_service.errors import InvalidPlantError, PlantInUseError, StoreNotReadyError
from nena_order_service.extension import EditPlant, Extension
from nena_order_service.plant_file import PLANT_MODEL, PlantFile, StoredPlant
from nena_order_service.service import CHANGING, OrderService
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import Supervisor, end

log = get_logger(__name__)

CHANGE_TIMEOUT = 20.0
"""Timeout of a host's change, seconds; the change may still succeed afterwards."""
RESTART_PAUSE = 10.0
"""Least time from one restart after an internal error to the next one, seconds."""


@dataclass(slots=True)
class _RequestedChange:
    model: PlantModel | EditPlant
    done: asyncio.Future[None]
    check_only: bool
    record: Callable[[Changes], None] = field(default_factory=current_recorder)
    """Adds the request to the audit trail, with the change."""


class ServiceRunner:
    """Runs an order service with the plant model of the file, or with one that a host uploaded instead.

    An uploaded model is used until the file changes. A change is checked and committed between two units of
    work; then the service is rebuilt on the same store, as after a restart. Orders and robots continue.
    """

    def __init__(
        self,
        file: PlantFile,
        store: Store,
        supervisor: Supervisor,
        *,
        make: Callable[[PlantModel], OrderService],
        show: Callable[[ASGIApp], None],
    ) -> None:
        """Run the service that ``make`` builds for the model of ``file`` or for its replacement.

        ``show`` receives the REST application of each service that replaces another one.
        """
        self.service: OrderService
        self._file = file
        self._store = store
        self._supervisor = supervisor
        self._make = make
        self._show = show
        self._tasks: list[asyncio.Task[None]] = []
        self._asked: asyncio.Queue[_RequestedChange | None] = asyncio.Queue()
        """Changes that hosts request; None: rebuild the service, because its engine has failed."""
        self._restart_at = 0.0
        """Earliest time of the next restart, by the clock of the event loop."""

    async def begin(self) -> None:
        """Start all tasks of the service.

        Raises:
            ConfigurationError: the plant model names an unsupported version.
        """
        self._supervisor.start("store", self._store.run())
        self.service = self._make(await self._present_model())
        await self._begin_service(self.service)
        self._supervisor.start("plant model", self._change_when_asked())

    async def change_plant(self, model: PlantModel | EditPlant, *, check_only: bool = False) -> None:
        """Use another plant model, or only check whether that is possible.

        A function receives the model that is current when its turn comes, so no change undoes another.

        Raises:
            InvalidPlantError: the model cannot be used.
            PlantInUseError: orders or vehicles use objects that the model lacks.
            StoreNotReadyError: the model cannot be stored, or another change is in progress.
        """
        asked = _RequestedChange(model, asyncio.get_running_loop().create_future(), check_only)
        if not self._asked.empty():
            raise StoreNotReadyError(CHANGING)
        self._asked.put_nowait(asked)
        try:
            async with asyncio.timeout(CHANGE_TIMEOUT):
                await asked.done
        except TimeoutError:
            raise StoreNotReadyError(CHANGING) from None

    async def _change_when_asked(self) -> None:
        while True:
            asked = await self._asked.get()
            if asked is None:
                await self._restart_service()
                continue
            try:
                await self._change_model(asked)
            except (InvalidPlantError, PlantInUseError, StoreNotReadyError) as error:
                # The timeout in change_plant cancels the future, which takes no result then.
                if not asked.done.done():
                    asked.done.set_exception(error)
            else:
                if not asked.done.done():
                    asked.done.set_result(None)

    async def _change_model(self, asked: _RequestedChange) -> None:
        old = self.service
        if old.engine.unit_of_work.failed.is_set():
            raise StoreNotReadyError(old.engine.unit_of_work.closed)
        model = asked.model if isinstance(asked.model, PlantModel) else asked.model(old.engine.plant)
        if model is old.engine.plant:
            return
        try:
            service = await asyncio.to_thread(self._make, model)
        except ConfigurationError as error:
            raise InvalidPlantError(error.problems) from error
        if problems := conflicts(old.engine, model, service.engine.registry):
            raise PlantInUseError(problems)
        if not self._store.ready:
            raise StoreNotReadyError(self._store.why_not_ready)
        if asked.check_only:
            return
        old.engine.close(CHANGING)  # nothing else has run since the check above
        await self._replace_service(service, partial(self._keep_model, model, asked.record))
        log.info("plant model changed", name=model.name, points=len(model.points))

    async def _restart_service(self) -> None:
        """Rebuild the service from the store; not at once again, if its engine fails again and again."""
        time = asyncio.get_running_loop().time
        await asyncio.sleep(self._restart_at - time())
        self._restart_at = time() + RESTART_PAUSE
        # 0008: memory may be half changed, and undoing that would need a copy of all of it.
        service = await asyncio.to_thread(self._make, self.service.engine.plant)
        await self._replace_service(service, partial(self._commit_after_all, Changes()))
        log.warning("restarted from the store after an internal error")

    async def _replace_service(self, service: OrderService, commit: Callable[[], Awaitable[None]]) -> None:
        """Run ``service`` in place of the present one, from what is stored after ``commit``."""
        old = self.service
        tasks, self._tasks = self._tasks, []
        await end(*tasks)
        await old.end()
        await commit()
        self.service = service
        try:
            await self._begin_service(service, old.extensions)
        except StoreNotReadyError as error:
            # Not an answer to a host: no engine is active any more, so the program must exit.
            message = "the order service cannot continue from its store: it is unavailable"
            raise RuntimeError(message) from error
        self._show(service.app)

    async def _begin_service(
        self,
        service: OrderService,
        previous: Mapping[str, Extension] = MappingProxyType({}),
    ) -> None:
        await service.begin(self._start_task, previous)
        gc.unfreeze()
        gc.collect()  # an earlier plant model
        gc.freeze()  # the new one, which each full collection would search

        async def request_restart() -> None:
            await service.engine.unit_of_work.failed.wait()
            self._asked.put_nowait(None)

        self._start_task("restart", request_restart(), vital=False)

    async def _keep_model(self, model: PlantModel, record: Callable[[Changes], None]) -> None:
        """Commit the model, however long the store takes."""
        content = model.model_dump_json(by_alias=True, exclude_none=True, exclude_unset=True)
        stored = StoredPlant(file=self._file.digest, model=content)
        changes = Changes()
        changes.documents[PLANT_MODEL, ""] = stored.model_dump_json()
        record(changes)
        await self._commit_after_all(changes)

    async def _commit_after_all(self, changes: Changes) -> None:
        """Commit all earlier changes and these."""
        done = asyncio.Event()
        self._store.commit(changes, done.set)
        await done.wait()

    async def _present_model(self) -> PlantModel:
        """Return the model that a host uploaded, unless the file has changed since."""
        document = (await self._store.documents(PLANT_MODEL)).get("")
        if document is None:
            return self._file.model
        try:
            stored = StoredPlant.model_validate_json(document)
            model = PlantModel.from_json(stored.model)
        except ValidationError:
            log.exception("the plant model in the store is unreadable; using the file")
            return self._file.model
        if stored.file != self._file.digest:
            log.warning("the plant model file has changed: using it, not the model activated last")
            await self._commit_after_all(Changes(documents={(PLANT_MODEL, ""): None}))
            return self._file.model
        log.info("using the model activated last, not the file", name=model.name, points=len(model.points))
        return model

    def _start_task(self, name: str, work: Any, *, vital: bool = True) -> asyncio.Task[None]:  # noqa: ANN401 - a coroutine
        task = self._supervisor.start(name, work, vital=vital)
        self._tasks.append(task)
        return task
