"""Units of work: changes that are committed together; then their effects run, and they are published."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import Protocol

from nena_order_service.engine.state import Effect, FleetState, PendingChanges
from nena_order_service.engine.status import Essentials
from nena_order_service.errors import RefusedError, StoreNotReadyError
from nena_order_service.fleet import outputs
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.fleet_api.peripherals import PeripheralJobStatus
from nena_shared.fleet_api.transport_order import OrderSequenceStatus, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.tasks import report_failure

UNPUBLISHED_AT_MOST = 20
"""Units of work after which a vehicle is published even if later ones that change it are pending."""


FAILED = (
    "an internal error has stopped a change; the order service restarts from its store, retry in a moment"
)


class Listener(Protocol):
    """Receives each change of orders and sequences, once it is committed."""

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Handle the new version of an order."""
        ...

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Handle the new version of an order sequence."""
        ...


class VehicleListener(Protocol):
    """Receives each change of vehicles, once it is committed."""

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Handle the new status of a vehicle."""
        ...


class PeripheralListener(Protocol):
    """Receives each change of peripheral jobs and devices, once it is committed."""

    def job_changed(self, status: PeripheralJobStatus) -> None:
        """Handle the new version of a job."""
        ...

    def peripheral_changed(self, location: str) -> None:
        """Handle a change of a device or its jobs."""
        ...


class UnitOfWork:
    """Commits changes together, then runs their effects and publishes them; units are never nested.

    Only the current status of a vehicle is published: if several uncommitted units change it, the last one
    publishes it, or every :data:`UNPUBLISHED_AT_MOST`-th one.
    """

    def __init__(
        self,
        state: FleetState,
        store: Store,
        vehicle_status: Callable[[str], VehicleStatus | None],
        on_event: Callable[[outputs.FleetOutput], None],
        *,
        timeout: float,
    ) -> None:
        """``on_event`` receives the events that effects return; ``timeout`` is for commits, seconds."""
        self.listeners: list[Listener] = []
        self.vehicle_listeners: list[VehicleListener] = []
        """Without any, no status of a vehicle is built."""
        self.peripheral_listeners: list[PeripheralListener] = []
        self.closed = ""
        """Why no more changes are accepted; empty while they are."""
        self.failed = asyncio.Event()
        """Set once a unit has failed, so that the state in memory is not that of the store."""
        self.recorders: list[Callable[[Changes], None]] = []
        """Add to changes who requested them; called before they are committed."""
        self._state = state
        self._store = store
        self._vehicle_status = vehicle_status
        self._on_event = on_event
        self._timeout = timeout
        self._unpublished: Counter[str] = Counter()
        """Number of uncommitted units that change each vehicle."""
        self._passed_over: Counter[str] = Counter()
        """Number of committed units that have not published each vehicle, because of later ones."""
        self._published: dict[str, Essentials] = {}

    @contextmanager
    def begin(self) -> Iterator[None]:
        """Collect the changes made in this context, commit them at its end, and publish them afterwards.

        After an exception nothing of them is committed, sent or published. What is in memory may be changed
        in part, though: then no more changes are accepted, and the service is rebuilt from the store.

        Raises:
            StoreNotReadyError: this engine accepts no more changes.
        """
        if self.closed:
            raise StoreNotReadyError(self.closed)
        try:
            yield
        except BaseException as error:
            changes = self._state.pending.take()
            # A request that was refused before it changed anything has left the state as it was.
            if changes or not isinstance(error, RefusedError):
                self._report_failure(
                    "unit of work failed and is not committed; restarting from the store", error
                )
            raise
        changes = self._state.pending.take()
        if changes:
            self._add_requesters(changes.stored)
            for name in changes.vehicles:
                self._unpublished[name] += 1
            self._store.commit(changes.stored, partial(self._on_committed, changes))

    def _report_failure(self, event: str, error: BaseException) -> None:
        report_failure(event, error)
        self.closed = FAILED
        self.failed.set()

    def committed(self) -> asyncio.Future[None]:
        """Return a future that is done when all changes so far are committed."""
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        with self.begin():
            # The store commits in order, so an effect of an empty unit runs after all earlier commits.
            self._state.after_commit(lambda: None if future.done() else future.set_result(None))
        return future

    def require_store(self) -> None:
        """Raise StoreNotReadyError if no change can be committed."""
        if not self._store.ready:
            raise StoreNotReadyError(self._store.why_not_ready)
        if self.closed:
            raise StoreNotReadyError(self.closed)

    @asynccontextmanager
    async def saved(self) -> AsyncIterator[None]:
        """Make a change of a host: refuse it if it cannot be committed, and wait at the end until it is.

        Raises:
            StoreNotReadyError: nothing was changed, or the change may be lost.
        """
        self.require_store()
        yield
        await self.wait_committed()

    async def wait_committed(self) -> None:
        """Wait until all changes so far are committed; raises StoreNotReadyError."""
        await self._wait_for_store(self.committed())

    async def commit(self, changes: Changes, then: Callable[[], None]) -> None:
        """Commit changes of documents outside the state, then call ``then``.

        Raises:
            StoreNotReadyError: the changes may be lost.
        """
        self.require_store()
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def committed() -> None:
            if not future.done():
                future.set_result(None)
            then()

        self._add_requesters(changes)
        self._store.commit(changes, committed)
        await self._wait_for_store(future)

    def _add_requesters(self, changes: Changes) -> None:
        for record in self.recorders:
            record(changes)

    async def _wait_for_store(self, answer: asyncio.Future[None]) -> None:
        self._store.fail_on_loss(answer)
        try:
            async with asyncio.timeout(self._timeout):
                await answer
        except TimeoutError:
            raise StoreNotReadyError(self._store.why_not_ready or "it did not answer in time") from None

    def is_published(self, name: str, now: Essentials) -> bool:
        """Return whether this status of a vehicle is published, or is about to be."""
        return name in self._unpublished or self._published.get(name) == now

    @property
    def published(self) -> Iterable[Essentials]:
        """The last published status of each vehicle."""
        return self._published.values()

    def _on_committed(self, changes: PendingChanges) -> None:
        self._state.orders.committed(changes.orders)
        self._state.sequences.committed(changes.sequences)
        self._state.peripheral_jobs.committed(changes.jobs)
        for effect in changes.effects:
            self._run_effect(effect)
        due = self._vehicles_to_publish(changes.vehicles)
        read = sorted(due) if self.vehicle_listeners else ()
        statuses = [status for name in read if (status := self._vehicle_status(name))]
        self._published.update({status.name: Essentials.of(status) for status in statuses})
        for listener in self.listeners:
            for sequence in changes.sequences:
                listener.sequence_changed(sequence.status)
            for order in changes.orders:
                listener.order_changed(order.status)
        for vehicle_listener in self.vehicle_listeners:
            for status in statuses:
                vehicle_listener.vehicle_changed(status)
        for peripheral_listener in self.peripheral_listeners:
            for job in changes.jobs:
                peripheral_listener.job_changed(job.status)
            for location in sorted(changes.peripherals):
                peripheral_listener.peripheral_changed(location)

    def _run_effect(self, effect: Effect) -> None:
        try:
            if event := effect():
                self._on_event(event)
        except Exception as error:  # noqa: BLE001 - it is reported
            self._report_failure("effect of a committed change failed; restarting from the store", error)

    def _vehicles_to_publish(self, vehicles: Iterable[str]) -> list[str]:
        """Return the vehicles whose status this commit publishes."""
        due = []
        for name in vehicles:
            self._unpublished[name] -= 1
            self._passed_over[name] += 1
            # A later unit publishes it. With a slow store there is always a later one, hence the limit.
            if self._unpublished[name] and self._passed_over[name] < UNPUBLISHED_AT_MOST:
                continue
            due.append(name)
            del self._passed_over[name]
            if not self._unpublished[name]:
                del self._unpublished[name]
        return due
