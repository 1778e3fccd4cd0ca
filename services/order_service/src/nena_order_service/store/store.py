"""The store as used by the event loop: one thread writes changes, others read."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from typing import TypeVar

from sqlalchemy import Engine

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store import audit, database
from nena_order_service.store.audit import AuditChain
from nena_order_service.store.database import Changes, Fence, OrderFilter, Unfinished, read_documents
from nena_order_service.store.instance_lock import InstanceLock
from nena_order_service.store.schema import TRANSIENT_ERRORS, FencedError, StoreLostError, reason_of
from nena_shared.database_connections import close_connections
from nena_shared.fleet_api.audit import AuditMark, AuditPage, AuditQuery
from nena_shared.fleet_api.requests import OrderSequencesQuery
from nena_shared.histogram import SHORT, Histogram
from nena_shared.log import get_logger
from nena_shared.tasks import report_failure, set_within

log = get_logger(__name__)

T = TypeVar("T")

RETRY_PAUSE = 0.5
"""Seconds between attempts to write while the database is unavailable."""

WAITING_LIMIT = 10_000
"""Maximum number of units of work waiting for the writer; beyond, new orders are refused."""


LOSS_SHOWN = 3.0
"""Seconds for which hosts and probes can see that the database file is gone before the program exits."""


class ChangeNumbers:
    """Counts the changes of all orders of a store, across restarts and takeovers.

    They follow the order in which changes are committed and published. If a unit of work changes an order
    several times, all of these versions have the same number.
    """

    def __init__(self) -> None:
        self.last = 0
        """The last number assigned."""
        self.published = 0
        """The last number of a published change."""
        self._unpublished: dict[str, deque[tuple[int, int]]] = {}
        """Unpublished versions and their numbers, by order name."""

    def number_changes(self, changes: Changes) -> None:
        """Number the changes of a unit of work."""
        self.last = changes.number_orders(self.last)
        for change in changes.orders.values():
            order = change.order
            versions = self._unpublished.setdefault(order.name, deque())
            versions.append((order.status.version, change.change_number))

    def continue_after(self, last: int) -> None:
        """Continue after the last number of the store."""
        self.last = self.published = last

    def number_of(self, name: str, version: int) -> tuple[int, bool]:
        """Return the number of a version to publish now, and whether it is the last version of its change.

        Versions are published in order. The number is 0 for a version that is published without a change.
        """
        versions = self._unpublished.get(name)
        while versions and versions[0][0] < version:
            versions.popleft()
        if not versions:
            self._unpublished.pop(name, None)
            return 0, False
        last_version, number = versions[0]
        if last_version > version:
            return number, False
        self.published = number
        versions.popleft()
        if not versions:
            del self._unpublished[name]
        return number, True


class Store:
    """Commits changes in order; all waiting ones are committed together.

    While the database fails, the commit is retried without limit, with pauses. Until it succeeds, nothing
    that depends on the changes is published. Call every method in the event loop's thread.
    """

    def __init__(
        self, engine: Engine, lock: InstanceLock | None = None, *, fence: Fence | None = None
    ) -> None:
        """Use an open database.

        Args:
            engine: the database.
            lock: keeps other processes off a file and detects its removal; released by :meth:`close`.
            fence: prevents writing to a store that another program has taken over.
        """
        self._engine = engine
        self._lock = lock
        self._fence = fence
        self._writer = ThreadPoolExecutor(1, thread_name_prefix="store writer")
        self._reader = ThreadPoolExecutor(1, thread_name_prefix="store reader")
        # Queries of the trail may scan millions of rows, and creating an order reads the store.
        self._audit_reader = ThreadPoolExecutor(1, thread_name_prefix="audit reader")
        self._changes = Changes()
        self._then: list[Callable[[], None]] = []
        self._wake = asyncio.Event()
        self._writing = False
        self.problem = ""
        """Why the last attempt to write failed; empty if it succeeded."""
        self.lead_problem = ""
        """Why it is uncertain whether this program may write to a shared store; empty if it may."""
        self._loss = ""
        """Why nothing is committed any more: the database file is gone, or the store taken over."""
        self._answers: set[asyncio.Future[None]] = set()
        self.commits = 0
        self.failures = 0
        """Number of failed commits, which were retried."""
        self.commit_seconds = Histogram(SHORT)
        self.numbers = ChangeNumbers()
        self._chain = AuditChain()

    @property
    def why_not_ready(self) -> str:
        """Return why new orders cannot be accepted; empty if they can."""
        full = "too many changes are waiting to be written" if len(self._then) >= WAITING_LIMIT else ""
        return self._why_file_is_lost() or self.problem or self.lead_problem or full

    @property
    def waiting(self) -> int:
        """Number of units of work that wait to be committed."""
        return len(self._then)

    @property
    def ready(self) -> bool:
        """Return whether new orders can be accepted."""
        return not self.why_not_ready

    def commit(self, changes: Changes, then: Callable[[], None]) -> None:
        """Call ``then`` once ``changes`` and all earlier ones are committed.

        It is called at once if there are no changes and nothing is waiting or lost.
        """
        if not changes and not self._writing and not self._then and not self._loss:
            then()
            return
        self.numbers.number_changes(changes)
        self._changes.merge(changes)
        self._then.append(then)
        self._wake.set()

    async def run(self) -> None:
        """Write until cancelled.

        Raises:
            SQLAlchemyError: the database rejects the changes themselves; continuing would lose them.
            FencedError: another order service has taken over the store.
            StoreLostError: the database file was deleted or replaced.
        """
        try:
            while True:
                await self._wake.wait()
                if self._why_file_is_lost():
                    await asyncio.sleep(LOSS_SHOWN)
                    raise StoreLostError(self._loss)
                await self._write_waiting()
        except FencedError as error:
            self._lose(str(error))
            raise

    def fail_on_loss(self, answer: asyncio.Future[None]) -> None:
        """Make ``answer`` raise StoreNotReadyError if the store is lost: nothing is committed any more."""
        self._answers.add(answer)
        answer.add_done_callback(self._answers.discard)
        if self._loss:
            self._lose(self._loss)

    async def drain(self, seconds: float) -> bool:
        """Wait at most ``seconds`` until everything is committed and published; return whether it is."""
        done = asyncio.Event()
        self.commit(Changes(), done.set)
        return await set_within(done, 0.0 if self._loss else seconds)

    def close(self) -> None:
        """Stop the threads, close the database and release its lock; pending queries are abandoned."""
        close_connections(self._engine)  # first: a thread only ends once its query does
        self._writer.shutdown()
        self._reader.shutdown()
        self._audit_reader.shutdown()
        self._engine.dispose()
        if self._lock:
            self._lock.release()

    async def read_unfinished(self) -> Unfinished:
        """Return everything that a restart restores."""
        unfinished = await self._read_from_store(lambda: database.read_unfinished(self._engine))
        self.numbers.continue_after(unfinished.last_change)
        return unfinished

    async def read_order(
        self, *, name: str | None = None, idempotency_key: str | None = None
    ) -> TransportOrder | None:
        """Read the order with this key, otherwise with this name."""
        return await self._read_from_store(
            lambda: database.read_order(self._engine, name=name, idempotency_key=idempotency_key)
        )

    async def read_orders(self, wanted: OrderFilter) -> tuple[TransportOrder, ...]:
        """Read a page of orders, newest first."""
        return await self._read_from_store(lambda: database.read_orders(self._engine, wanted))

    async def read_order_number_at(self, moment: datetime) -> int:
        """Return the lowest number of the orders created at ``moment`` or later; if none, the next number."""
        return await self._read_from_store(lambda: database.read_number_at(self._engine, moment))

    async def read_sequence(
        self, *, name: str | None = None, idempotency_key: str | None = None
    ) -> OrderSequence | None:
        """Read the order sequence with this key, otherwise with this name."""
        return await self._read_from_store(
            lambda: database.read_sequence(self._engine, name=name, idempotency_key=idempotency_key)
        )

    async def read_sequences(self, wanted: OrderSequencesQuery) -> tuple[OrderSequence, ...]:
        """Read a page of order sequences, newest first."""
        return await self._read_from_store(lambda: database.read_sequences(self._engine, wanted))

    async def read_path_locks(self) -> dict[str, bool]:
        """Read which paths hosts have locked or unlocked, by path name."""
        return await self._read_from_store(lambda: database.read_path_locks(self._engine))

    async def documents(self, kind: str) -> dict[str, str]:
        """Read the documents of a kind, by name."""
        return await self._read_from_store(lambda: read_documents(self._engine, kind))

    async def document(self, kind: str, name: str) -> str | None:
        """Read the document of a kind and name."""
        return await self._read_from_store(lambda: database.read_document(self._engine, kind, name))

    async def read_audit_page(self, wanted: AuditQuery) -> AuditPage:
        """Read a page of the audit trail."""
        return await self._read_from_store(lambda: audit.read_page(self._engine, wanted), self._audit_reader)

    async def read_expired_audit(self, limit: datetime) -> AuditMark | None:
        """Read the last of the oldest rows of the audit trail that are from before ``limit``."""
        return await self._read_from_store(
            lambda: audit.read_expired(self._engine, limit), self._audit_reader
        )

    async def read_changes_after(self, number: int, limit: int) -> tuple[tuple[int, TransportOrder], ...]:
        """Read the orders changed since change ``number``, each with the number of its last change."""
        return await self._read_from_store(lambda: database.read_changes(self._engine, number, limit))

    async def _read_from_store(self, work: Callable[[], T], reader: ThreadPoolExecutor | None = None) -> T:
        def work_with_retry() -> T:
            try:
                return work()
            except TRANSIENT_ERRORS as error:
                # A server that was restarted ends the pooled connection; the next attempt opens another.
                if not error.connection_invalidated:
                    raise
            return work()

        try:
            return await asyncio.get_running_loop().run_in_executor(reader or self._reader, work_with_retry)
        except TRANSIENT_ERRORS as error:
            raise StoreNotReadyError(reason_of(error)) from error

    async def _write_waiting(self) -> None:
        changes, then = self._changes, self._then
        self._changes, self._then = Changes(), []
        self._wake.clear()
        self._writing = True
        try:
            if changes:
                await self._write_changes(changes)
                if self._why_file_is_lost():
                    return  # the commit is lost with its file, so it is not published
            for publish in then:
                if self._loss:
                    break  # what is not published yet is lost with the database file
                try:
                    publish()
                except Exception as error:  # noqa: BLE001 - it is reported
                    report_failure("a committed change was not published", error)
        finally:
            self._writing = False

    async def _write_changes(self, changes: Changes) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                with self.commit_seconds.timed():
                    await loop.run_in_executor(
                        self._writer, database.commit_changes, self._engine, changes, self._fence, self._chain
                    )
            except TRANSIENT_ERRORS as error:
                self.failures += 1
                self._set_problem(reason_of(error))
                await asyncio.sleep(RETRY_PAUSE)
            else:
                self.commits += 1
                self._set_problem("")
                return

    def _why_file_is_lost(self) -> str:
        """Check the database file; return why it is no longer the one that was opened, empty if it is."""
        if not self._loss and self._lock and (loss := self._lock.why_lost()):
            log.critical("accepting no more orders; the order service exits", reason=loss)
            self._lose(loss)
            self._wake.set()
        return self._loss

    def _lose(self, loss: str) -> None:
        self._loss = loss
        for answer in self._answers:
            if not answer.done():
                answer.set_exception(StoreNotReadyError(loss))

    def _set_problem(self, problem: str) -> None:
        if problem and problem != self.problem:
            log.error("database unavailable; retrying; check its disk or server", reason=problem)
        if self.problem and not problem:
            log.info("database available again")
        self.problem = problem
