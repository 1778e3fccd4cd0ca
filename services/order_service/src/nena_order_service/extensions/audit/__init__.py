"""The audit trail: a row for each changing request, by REST, MQTT and openTCS's web API.

A request that changes the store is recorded in the same transaction as its change. Refused requests, instant
actions, and requests without effect are recorded when they end; none of them waits for that.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from typing import ClassVar, Final

from fastapi import APIRouter
from pydantic import BaseModel, Field

from nena_order_service.api.audit import OpenRequest
from nena_order_service.api.operations import Handler
from nena_order_service.errors import StoreNotReadyError
from nena_order_service.extension import Core, Extension
from nena_order_service.extensions.audit.csv_file import audit_csv
from nena_order_service.extensions.audit.states import ObjectStates, created_in
from nena_order_service.store.audit import AuditRow
from nena_order_service.store.database import Changes
from nena_shared.fleet_api.audit import AuditPage, AuditQuery, AuditResult
from nena_shared.fleet_api.operations.fleet import LIST_AUDIT
from nena_shared.log import get_logger
from nena_shared.settings import SettingsGroup

log = get_logger(__name__)

WAITING_LIMIT: Final = 1000
"""Maximum number of rows waiting for the database on their own; beyond it, they are only logged."""

LOOK_INTERVAL: Final = 3600.0
"""Seconds between searches for rows to delete."""
RETRY_INTERVAL: Final = 60.0
"""The same while the database is unavailable."""


class AuditSettings(SettingsGroup):
    """The audit trail."""

    kept_days: int = Field(
        90, ge=1, le=36_500, description="Time for which rows of the audit trail are kept, days."
    )


@dataclass(slots=True)
class _Recorded:
    """What the trail knows of an open request."""

    before: str
    """State of the object before the request, as JSON."""
    is_recorded: bool = False


class AuditTrail(Extension):
    """Records requests, serves the trail, and deletes rows that are too old."""

    Settings: ClassVar[type[BaseModel]] = AuditSettings

    def __init__(self, settings: AuditSettings, core: Core) -> None:
        super().__init__(settings, core)
        self.clock = core.clock
        self._store = core.store
        self._states = ObjectStates(core.engine, core.hosts.zones)
        self._kept = timedelta(days=settings.kept_days)
        self._open: dict[OpenRequest, _Recorded] = {}
        self._waiting = 0
        """Number of rows that wait for the database on their own."""

    def handlers(self) -> Iterable[Handler]:
        """Return what lists the trail."""
        return (Handler(LIST_AUDIT, lambda request: self.read_page(wanted=request)),)

    def routers(self) -> Iterable[APIRouter]:
        """Return the route of the CSV file."""
        return (audit_csv(self.read_page),)

    def tasks(self) -> Mapping[str, Callable[[], Awaitable[None]]]:
        """Return what deletes old rows."""
        return {"audit trail": self.delete_periodically}

    def request_begun(self, request: OpenRequest) -> None:
        """Note the state of the object."""
        self._open[request] = _Recorded(self._state_of(request, request.asked.kind, request.name))

    def committing(self, request: OpenRequest, changes: Changes) -> None:
        """Add the row to a change of the request; a request for many objects gets a row for each."""
        asked, recorded = request.asked, self._open[request]
        created = created_in(changes, asked.creates) if asked.creates else ""
        if asked.creates_many:
            if created:
                state = self._state_of(request, asked.creates, created, changes)
                row = self._make_row(request, AuditResult.DONE, name=created, after=state, body=str)
                changes.audit.append(row)
        elif not recorded.is_recorded:
            # A request may cause several commits; the first one records it.
            recorded.is_recorded = True
            name = created if created and asked.creates == asked.kind else request.name
            state = request.after or self._state_of(request, asked.kind, name, changes)
            if created and asked.creates != asked.kind:  # such as the order of a dispatched vehicle
                state = json.dumps({asked.creates: created}, ensure_ascii=False)
            changes.audit.append(self._make_row(request, AuditResult.DONE, name=name, after=state))

    def request_ended(self, request: OpenRequest, result: AuditResult, reason: str) -> None:
        """Record the request unless its change was recorded; a failure is recorded in any case."""
        asked, recorded = request.asked, self._open[request]
        if result is not AuditResult.DONE:
            self._commit_row(self._make_row(request, result, name=request.name, reason=reason))
        elif not recorded.is_recorded:
            state = request.after or self._state_of(request, asked.kind, request.name)
            if asked.creates == asked.kind and not asked.creates_many:
                recorded.before = state  # it was created before, by the same request
            self._commit_row(self._make_row(request, result, name=request.name, after=state))
        del self._open[request]

    def _state_of(self, request: OpenRequest, kind: str, name: str, changes: Changes | None = None) -> str:
        return self._states.describe_object(kind, name, changes, request.asked.state)

    def _make_row(
        self,
        request: OpenRequest,
        result: AuditResult,
        *,
        name: str,
        after: str = "",
        reason: str = "",
        body: Callable[[], str] | None = None,
    ) -> AuditRow:
        asked = request.asked
        return AuditRow(
            time=self.clock.now(),
            user=asked.origin.user,
            interface=asked.origin.interface,
            client=asked.origin.client,
            operation=asked.operation,
            object_kind=asked.kind,
            object_name=name,
            request=body or asked.body,
            before=self._open[request].before,
            after=after,
            result=result,
            reason=reason,
        )

    def _commit_row(self, row: AuditRow) -> None:
        """Commit a row on its own, soon; during a long failure of the database it is only logged."""
        # Anybody can have requests refused; without a limit they would fill the memory during a failure.
        if self._waiting >= WAITING_LIMIT:
            log.error(
                "not in the audit trail: database unavailable",
                user=row.user,
                operation=row.operation,
                object=row.object_name,
                result=row.result.value,
            )
            return
        self._waiting += 1
        # 0055: not waited for, because pausing a robot must not depend on a disk.
        self._store.commit(Changes(audit=[row]), self._row_written)

    def _row_written(self) -> None:
        self._waiting -= 1

    async def read_page(self, wanted: AuditQuery) -> AuditPage:
        """Read a page of the trail; raises StoreNotReadyError."""
        return await self._store.read_audit_page(wanted)

    async def delete_periodically(self) -> None:
        """Delete rows that are too old, and wait until it is time to look again."""
        try:
            await self.delete_expired()
        except StoreNotReadyError:
            await asyncio.sleep(RETRY_INTERVAL)
        else:
            await asyncio.sleep(LOOK_INTERVAL)

    async def delete_expired(self) -> None:
        """Delete the rows that are too old now; the hash of the last one is kept.

        Raises:
            StoreNotReadyError: the store cannot be read.
        """
        while mark := await self._store.read_expired_audit(self.clock.now() - self._kept):
            done = asyncio.Event()
            self._store.commit(Changes(expired_audit=mark), done.set)
            await done.wait()
            log.info("old rows of the audit trail deleted", up_to=mark.sequence)
