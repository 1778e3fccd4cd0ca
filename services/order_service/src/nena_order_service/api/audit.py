"""The audit trail: a row for each changing request, by REST, MQTT and openTCS's web API.

A request that changes the store is recorded in the same transaction as its change. Refused requests, instant
actions, and requests without effect are recorded when they end; none of them waits for that.
"""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import timedelta
from functools import partial
from typing import Any, Final

from pydantic import BaseModel
from starlette.requests import HTTPConnection

from nena_order_service.api.audit_states import DescribeObject, ObjectStates, created_in
from nena_order_service.api.problems import FORESEEN, problem_of
from nena_order_service.errors import RefusedError, StoreNotReadyError
from nena_order_service.store.audit import AuditRow
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from nena_shared.clock import Clock
from nena_shared.fleet_api.audit import ANONYMOUS, AuditInterface, AuditPage, AuditQuery, AuditResult
from nena_shared.log import get_logger
from nena_shared.web.access import user_of

log = get_logger(__name__)

SECRET: Final = re.compile(
    r"password|passphrase|passcode|passwd|pwd|secret|credential|authori[sz]ation|bearer|psk$|pin.?code"
    r"|(private|api|access|encryption).?key|(access|auth|refresh|session).?token|^token$",
    re.IGNORECASE,
)
"""Names of fields and keys of properties and parameters whose values are masked."""
MASK: Final = "***"

WAITING_LIMIT: Final = 1000
"""Maximum number of rows waiting for the database on their own; beyond it, they are only logged."""

LOOK_INTERVAL: Final = 3600.0
"""Seconds between searches for rows to delete."""
RETRY_INTERVAL: Final = 60.0
"""The same while the database is unavailable."""

INTERRUPTED: Final = "interrupted by a shutdown or a change of the plant model"


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a request comes from."""

    interface: AuditInterface
    user: str = ANONYMOUS
    client: str = ""
    """User-Agent of a REST client."""


@dataclass(frozen=True, slots=True)
class ChangingRequest:
    """A request as recorded."""

    origin: Origin
    operation: str
    kind: str
    """Kind of the object, such as ``vehicle``."""
    name: str
    """Name of the object; empty if the request creates it."""
    body: Callable[[], str]
    """Serialises the body; called by the store's writer."""
    creates: str = ""
    """Kind of the objects that the request creates; empty: none."""
    creates_many: bool = False
    """Whether each created object gets a row, besides the one of the request."""
    joins: bool = True
    """Whether the row is committed with the request's change; otherwise when the request ends."""
    state: DescribeObject | None = None
    """Describes the object, if it is of a kind that the core does not have."""


_CURRENT: ContextVar[OpenRequest | None] = ContextVar("audited request", default=None)


def record_current(changes: Changes) -> None:
    """Add the row of the request that this task executes to its ``changes``; do nothing outside a request."""
    if (current := _CURRENT.get()) is not None:
        current.committing(changes)


def recorder() -> Callable[[Changes], None]:
    """Return :func:`record_current` for another task, which executes the current request."""
    current = _CURRENT.get()
    return (lambda _: None) if current is None else current.committing


class OpenRequest:
    """A changing request that has not ended."""

    def __init__(self, trail: Trail, asked: ChangingRequest) -> None:
        self.name = asked.name
        """Name of the object, as far as it is known."""
        self.after = ""
        """State of the object after the request, as JSON; empty: described when the row is written."""
        self._trail = trail
        self._asked = asked
        self._before = self._state_of(asked.kind, asked.name)
        self._is_recorded = self._is_over = False

    def committing(self, changes: Changes) -> None:
        """Add the row to a change of this request that is about to be committed."""
        if self._is_over or not changes or not self._asked.joins:
            return
        created = created_in(changes, self._asked.creates) if self._asked.creates else ""
        if self._asked.creates_many:
            if created:
                after = self._state_of(self._asked.creates, created, changes)
                changes.audit.append(self._row(AuditResult.DONE, name=created, after=after, body=str))
        elif not self._is_recorded:
            self._is_recorded = True
            changes.audit.append(self._row_of(created, changes))

    def end(self, result: AuditResult, reason: str = "") -> None:
        """Record the request unless its change was recorded; a failure is recorded in any case."""
        if self._is_over:
            return
        self._is_over = True
        if result is not AuditResult.DONE:
            self._trail.add(self._row(result, name=self.name, reason=reason))
        elif not self._is_recorded:
            after = self.after or self._state_of(self._asked.kind, self.name)
            if self._asked.creates == self._asked.kind and not self._asked.creates_many:
                self._before = after  # it was created before, by the same request
            self._trail.add(self._row(result, name=self.name, after=after))

    def _state_of(self, kind: str, name: str, changes: Changes | None = None) -> str:
        return self._trail.states.of(kind, name, changes, self._asked.state)

    def _row_of(self, created: str, changes: Changes) -> AuditRow:
        asked = self._asked
        name = created if created and asked.creates == asked.kind else self.name
        after = self.after or self._state_of(asked.kind, name, changes)
        if created and asked.creates != asked.kind:  # such as the order of a dispatched vehicle
            after = json.dumps({asked.creates: created}, ensure_ascii=False)
        return self._row(AuditResult.DONE, name=name, after=after)

    def _row(
        self,
        result: AuditResult,
        *,
        name: str,
        after: str = "",
        reason: str = "",
        body: Callable[[], str] | None = None,
    ) -> AuditRow:
        asked, origin = self._asked, self._asked.origin
        return AuditRow(
            time=self._trail.clock.now(),
            user=origin.user,
            interface=origin.interface,
            client=origin.client,
            operation=asked.operation,
            object_kind=asked.kind,
            object_name=name,
            request=body or asked.body,
            before=self._before,
            after=after,
            result=result,
            reason=reason,
        )


class Trail:
    """Records requests, and deletes rows that are too old."""

    def __init__(self, store: Store, clock: Clock, states: ObjectStates, *, kept_days: int) -> None:
        self.clock = clock
        self.states = states
        self._store = store
        self._kept = timedelta(days=kept_days)
        self._waiting = 0
        """Number of rows that wait for the database on their own."""

    @contextmanager
    def recorded(self, asked: ChangingRequest) -> Iterator[OpenRequest]:
        """Record a request, which is executed in this context, with its result."""
        request = OpenRequest(self, asked)
        token = _CURRENT.set(request)
        try:
            yield request
        except FORESEEN as error:
            request.end(AuditResult.REFUSED, _reason(error))
            raise
        except asyncio.CancelledError:
            request.end(AuditResult.FAILED, INTERRUPTED)
            raise
        except Exception as error:
            request.end(AuditResult.FAILED, type(error).__name__)
            raise
        else:
            request.end(AuditResult.DONE)
        finally:
            _CURRENT.reset(token)

    def add(self, row: AuditRow) -> None:
        """Commit a row on its own, soon; during a long failure of the database it is only logged."""
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
        self._store.commit(Changes(audit=[row]), self._written)

    def _written(self) -> None:
        self._waiting -= 1

    async def page(self, wanted: AuditQuery) -> AuditPage:
        """Read a page of the trail; raises StoreNotReadyError."""
        return await self._store.audit_page(wanted)

    async def run(self) -> None:
        """Delete rows that are too old periodically, until cancelled."""
        while True:
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
        while mark := await self._store.expired_audit(self.clock.now() - self._kept):
            done = asyncio.Event()
            self._store.commit(Changes(expired_audit=mark), done.set)
            await done.wait()
            log.info("old rows of the audit trail deleted", up_to=mark.sequence)


def _reason(error: Exception) -> str:
    """Return why a request was refused: the name of the refusal, and its text."""
    if isinstance(error, RefusedError):
        return f"{error.refusal.name}: {error}"
    problem = problem_of(error)
    return "; ".join(problem.errors) or problem.detail


def body_of_model(request: BaseModel | None) -> Callable[[], str]:
    """Return a function that serialises a request's fields as sent by its client."""
    return str if request is None else partial(_serialised, request)


def _serialised(request: BaseModel) -> str:
    return masked(request.model_dump(mode="json", by_alias=True, exclude_unset=True))


def masked(content: Any) -> str:  # noqa: ANN401 - of JSON
    """Return content as JSON, without the values of secrets."""
    return json.dumps(_masked(content), ensure_ascii=False, separators=(",", ":"))


def _masked(content: Any) -> Any:  # noqa: ANN401 - of JSON
    if isinstance(content, dict):
        key = content.get("key", content.get("name"))
        named = isinstance(key, str) and SECRET.search(key) is not None
        return {
            name: MASK if SECRET.search(name) or (named and name == "value") else _masked(value)
            for name, value in content.items()
        }
    return [_masked(each) for each in content] if isinstance(content, list) else content


def origin_of(http: HTTPConnection, interface: AuditInterface) -> Origin:
    """Return the origin of a request over HTTP."""
    user = user_of(http.scope)
    client = http.headers.get("user-agent", "")
    return Origin(interface, user.known_as if user else ANONYMOUS, client)


def kind_of(path: str) -> str:
    """Return the kind of the objects below a path of the API: ``vehicle`` for ``/v1/vehicles/{name}``."""
    return path.split("/")[2].removesuffix("s")
