"""Host operations: what executes each operation of the table, the same over REST and MQTT.

A file per noun (``orders``, ``vehicles``, ...) lists its operations with the methods that execute them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from functools import partial
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
    kind_of_path,
    serialiser_of,
    to_masked_json,
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
        # Proxies that compress an answer, such as nginx, make its tag a weak one (W/).
        tags = {part.strip().removeprefix("W/") for part in self.value.split(",")}
        return bool(tags & {ANY, f'"{version}"'})

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
        # Inspected once, not at each request.
        self._parameters = {
            name: tuple(signature(handler.execute).parameters) for name, handler in self.handlers.items()
        }

    async def execute(self, operation: Operation[Any], call: Call[Any]) -> Reply:
        """Execute an operation; raises the errors in :mod:`nena_order_service.errors`."""
        handler = self.handlers[operation.name]
        values = {name: getattr(call, name) for name in self._parameters[operation.name]}
        # 0055: recorded at this one place, so that no new operation can be forgotten.
        recording: AbstractContextManager[OpenRequest | None] = (
            nullcontext()
            if operation.method == "GET"
            else self.trail.record_request(_changing_request(operation, call, handler.state))
        )
        with recording as request:
            answer = handler.execute(**values)
            if isawaitable(answer):
                answer = await answer
            if isinstance(answer, Reply):
                reply = answer
            elif isinstance(answer, tuple):
                body, new = answer
                reply = Reply(body, status_for(new=new))
            else:
                reply = Reply(answer, status_for(new=bool(operation.creates)))
            if request:
                # The order service may have made the name, and a batch has none.
                request.name = request.name or getattr(reply.body, "name", "")
                request.after = _outcome_of(reply.body)
            return reply


def _changing_request(
    operation: Operation[Any], call: Call[Any], state: DescribeObject | None
) -> ChangingRequest:
    """Return what the audit trail records of a request."""
    is_batch = operation is CREATE_ORDERS
    body = serialiser_of(call.request)
    if is_batch:
        batch: TransportOrderBatch = call.request
        # Only the size: each order of the batch is recorded with its own change.
        size = {"transportOrders": len(batch.transport_orders), "checkOnly": batch.check_only}
        body = partial(to_masked_json, size)
    creates = operation.creates or (operation.path if is_batch or operation is STOP else "")
    return ChangingRequest(
        origin=call.origin,
        operation=operation.name,
        kind=kind_of_path(operation.path),
        name=call.request.zone_set_id if operation is PUT_ZONE_SET else call.name,
        body=body,
        creates=kind_of_path(creates) if creates else "",
        creates_many=is_batch,
        # What an instant action has done is known only when the robot answers.
        joins=operation is not INSTANT_ACTION,
        state=state,
    )


def page_of(objects: Iterable[N], limit: int | None) -> tuple[tuple[N, ...], str | None]:
    """Return the first ``limit`` objects, and the name of the last of them if there are more; None: all."""
    page = tuple(objects if limit is None else islice(objects, limit + 1))
    if limit is None or len(page) <= limit:
        return page, None
    return page[:limit], page[limit - 1].name


def status_for(*, new: bool) -> HTTPStatus:
    """Return the status of an answer with an object that the request, or the same one before, has created."""
    return HTTPStatus.CREATED if new else HTTPStatus.OK


def _outcome_of(body: BaseModel | bytes) -> str:
    """Return the outcome of requests that end without a change of an object; empty for others."""
    if isinstance(body, InstantActionAnswer):
        return to_masked_json({"actionId": body.action_id, "status": body.status})
    if isinstance(body, TransportOrderBatchAnswer):
        statuses = Counter(result.status for result in body.results)
        return to_masked_json({str(status): count for status, count in sorted(statuses.items())})
    return ""
