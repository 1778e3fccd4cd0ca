"""Host operations: what executes each operation of the table, the same over REST and MQTT.

A file per noun (``orders``, ``vehicles``, ...) lists its operations with the methods that execute them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from http import HTTPStatus
from inspect import isawaitable, signature
from itertools import islice
from typing import Any, Generic, Protocol, TypeVar

from pydantic import BaseModel

from nena_order_service.api.audit import (
    ChangingRequest,
    DescribeObject,
    OpenRequest,
    Origin,
    Trail,
    body_of_model,
    kind_of,
    masked,
)
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.operations.fleet import STOP
from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.operations.orders import CREATE_ORDERS
from nena_shared.fleet_api.operations.plant import PUT_ZONE_SET
from nena_shared.fleet_api.operations.vehicles import INSTANT_ACTION
from nena_shared.fleet_api.requests import InstantActionAnswer
from nena_shared.fleet_api.transport_order import TransportOrderBatch, TransportOrderBatchAnswer

R = TypeVar("R")


class Named(Protocol):
    """An object in a list."""

    @property
    def name(self) -> str:
        """Return its name."""
        ...


N = TypeVar("N", bound=Named)

ANY = "*"


@dataclass(frozen=True, slots=True)
class ETag:
    """Value of a header If-Match or If-None-Match: one tag, several separated by commas, or ``*`` for any."""

    value: str

    @classmethod
    def of(cls, version: int) -> ETag:
        """Return the tag of a version."""
        return cls(f'"{version}"')

    def fits(self, version: int) -> bool:
        """Return whether this version is among the named ones."""
        named = {part.strip().removeprefix("W/") for part in self.value.split(",")}
        return bool(named & {ANY, f'"{version}"'})

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True, slots=True)
class Call(Generic[R]):
    """One request of a host."""

    name: str
    """Name of the object; empty if the operation has none."""
    request: R
    caller: str
    """The caller, as identified by access control."""
    seen: ETag | None = None
    """Version that the host has seen; None: any."""
    origin: Origin = field(default_factory=lambda: Origin(AuditInterface.REST))
    """The origin of the request, for the audit trail."""


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to a successful request."""

    body: BaseModel | bytes
    """The answer; bytes: a page in JSON, whose objects would take five times the memory as models."""
    status: HTTPStatus = HTTPStatus.OK


@dataclass(frozen=True, slots=True)
class Handler:
    """What executes an operation, and examples of it for the OpenAPI document."""

    operation: Operation[Any]
    execute: Callable[..., Any]
    """Takes what it names of a call: ``name``, ``request``, ``caller``, ``seen``.

    Returns the answer or an awaitable of it: an object, an object and whether it is new, or a Reply. A change
    is committed before it returns. Raises the errors in :mod:`nena_order_service.errors`.
    """
    body: Any = None
    """An example of the request's body."""
    answer: Any = None
    """An example of the answer, where its fields need no long history to be understood."""
    state: DescribeObject | None = None
    """Describes the object for the audit trail; None: of a kind that the core has, or of no kind."""


class HostOperations:
    """Executes operations; ``trail`` records those that change something."""

    def __init__(self, trail: Trail, handlers: Iterable[Handler]) -> None:
        self.trail = trail
        self.handlers = {handler.operation.name: handler for handler in handlers}
        self._needs = {
            name: tuple(signature(each.execute).parameters) for name, each in self.handlers.items()
        }

    async def execute(self, operation: Operation[Any], call: Call[Any]) -> Reply:
        """Execute an operation; raises the errors in :mod:`nena_order_service.errors`."""
        values = {name: getattr(call, name) for name in self._needs[operation.name]}
        reads = operation.method == "GET"
        recording: AbstractContextManager[OpenRequest | None] = (
            nullcontext() if reads else self.trail.recorded(self._changing_request(operation, call))
        )
        with recording as recorded:
            answer = self.handlers[operation.name].execute(**values)
            if isawaitable(answer):
                answer = await answer
            reply = _make_reply(operation, answer)
            if recorded:
                recorded.name = recorded.name or getattr(reply.body, "name", "")
                recorded.after = _outcome_of(reply.body)
            return reply

    def _changing_request(self, operation: Operation[Any], call: Call[Any]) -> ChangingRequest:
        """Return what the audit trail records of a request."""
        is_batch = operation is CREATE_ORDERS
        creates = operation.creates or (operation.path if is_batch or operation is STOP else "")
        return ChangingRequest(
            origin=call.origin,
            operation=operation.name,
            kind=kind_of(operation.path),
            name=call.request.zone_set_id if operation is PUT_ZONE_SET else call.name,
            body=_size_of_batch(call.request) if is_batch else body_of_model(call.request),
            creates=kind_of(creates) if creates else "",
            creates_many=is_batch,
            joins=operation is not INSTANT_ACTION,
            state=self.handlers[operation.name].state,
        )


def page_of(objects: Iterable[N], limit: int | None) -> tuple[tuple[N, ...], str | None]:
    """Return the first ``limit`` objects, and the name of the last of them if there are more; None: all."""
    page = tuple(objects if limit is None else islice(objects, limit + 1))
    if limit is None or len(page) <= limit:
        return page, None
    return page[:limit], page[limit - 1].name


def created(*, new: bool) -> HTTPStatus:
    """Return the status of an answer with an object that the request, or the same one before, has created."""
    return HTTPStatus.CREATED if new else HTTPStatus.OK


def _make_reply(operation: Operation[Any], answer: Any) -> Reply:  # noqa: ANN401 - see Handler.execute
    if isinstance(answer, Reply):
        return answer
    if isinstance(answer, tuple):
        body, new = answer
        return Reply(body, created(new=new))
    return Reply(answer, created(new=bool(operation.creates)))


def _size_of_batch(batch: TransportOrderBatch) -> Callable[[], str]:
    content = {"transportOrders": len(batch.transport_orders), "checkOnly": batch.check_only}
    return lambda: masked(content)


def _outcome_of(body: BaseModel | bytes) -> str:
    """Return the outcome of requests that end without a change of an object; empty for others."""
    if isinstance(body, InstantActionAnswer):
        return masked({"actionId": body.action_id, "status": body.status})
    if isinstance(body, TransportOrderBatchAnswer):
        statuses = Counter(result.status for result in body.results)
        return masked({str(status): count for status, count in sorted(statuses.items())})
    return ""
