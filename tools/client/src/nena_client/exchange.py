"""Requests, answers, events, and which of several order services to ask; without I/O."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, TypedDict, TypeVar
from uuid import uuid4

import httpx
from pydantic import BaseModel, JsonValue, ValidationError

from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.requests import (
    OrderSequencePage,
    Readiness,
    TransportOrderPage,
    VehicleList,
)
from nena_shared.fleet_api.transport_order import Problem, TransportOrderBatch

if TYPE_CHECKING:
    from nena_shared.fleet_api.audit import AuditPage
    from nena_shared.fleet_api.places import LocationPage, PointPage
    from nena_shared.fleet_api.plant import PathPage

A = TypeVar("A", bound=BaseModel)
P = TypeVar(
    "P",
    TransportOrderPage,
    OrderSequencePage,
    VehicleList,
    "PathPage",
    "AuditPage",
    "PointPage",
    "LocationPage",
)
Query = Mapping[str, str | int | datetime | Sequence[str] | None]
"""Values of a query; None: not stated. A time without a zone is local."""

PAGE = 200
"""Items per page."""
CONNECT_SECONDS = 5.0
"""Timeout of a connection, and of the answer about readiness, which needs no work, seconds."""
ANSWER_SECONDS = 30.0
"""Timeout of a request, seconds; longer than the order service waits for its store and for robots."""
ANSWER = httpx.Timeout(ANSWER_SECONDS, connect=CONNECT_SECONDS)
SILENCE_SECONDS = 20.0
"""Seconds without data after which an event stream is broken; it has a heartbeat every five seconds."""
STREAM = httpx.Timeout(SILENCE_SECONDS, connect=CONNECT_SECONDS)
EVENTS = "/v1/events"
NOT_SENT = (httpx.ConnectError, httpx.ConnectTimeout)
PASSING = (HTTPStatus.BAD_GATEWAY, HTTPStatus.SERVICE_UNAVAILABLE, HTTPStatus.GATEWAY_TIMEOUT)
"""Statuses of an order service that starts, waits for its database, or changes its plant model."""
KEY = "idempotencyKey"
NOT_ONE = "is not an order service; check the URL"


class RefusedError(Exception):
    """The order service rejected a request; the text says why and what to do."""

    def __init__(self, problem: Problem) -> None:
        super().__init__("\n".join([problem.detail, *(f"- {error}" for error in problem.errors)]))
        self.problem = problem

    @property
    def passing(self) -> bool:
        """Whether the same request may succeed in a moment."""
        return self.problem.status in PASSING


class UnreachableError(Exception):
    """No order service answers, or none of those that answer is active."""


class Options(TypedDict, total=False):
    """What a call may state besides its request model."""

    query: Query | None
    body: JsonValue
    """Body as JSON, for callers that have no model."""
    content: bytes | None
    """Body as bytes, such as a plant model."""
    headers: Mapping[str, str] | None


@dataclass(frozen=True, slots=True)
class Call:
    """A request to any of the order services."""

    method: str
    path: str
    arguments: dict[str, Any]
    """Arguments of httpx's ``request``."""
    repeatable: bool
    """Whether sending it twice has no other effect than sending it once."""

    @classmethod
    def of(cls, operation: Operation[Any], name: str, request: BaseModel | None, options: Options) -> Call:
        """Return the request of an operation.

        A request that creates orders gets an idempotency key for each that has none.
        """
        query, body = options.get("query"), options.get("body")
        if request is not None:
            fields = request.model_dump(mode="json", by_alias=True, exclude_unset=True)
            if operation.method == "GET":
                query = {**fields, **(query or {})}
            else:
                body = _with_keys(request, fields)
        arguments = {
            "params": params_of(query),
            "json": body,
            "content": options.get("content"),
            "headers": options.get("headers"),
        }
        repeatable = operation.method != "POST" or _has_keys(body)
        return cls(operation.method, operation.path_of(name), arguments, repeatable)


def params_of(query: Query | None) -> dict[str, Any]:
    """Return the parameters of a URL: those that a query states, times with their zone."""
    return {
        name: value.astimezone().isoformat() if isinstance(value, datetime) else value
        for name, value in (query or {}).items()
        if value is not None
    }


def _with_keys(request: BaseModel, fields: dict[str, Any]) -> dict[str, Any]:
    """Return the body of a request, with an idempotency key for each order without one."""
    if isinstance(request, TransportOrderBatch):
        each = zip(request.transport_orders, fields["transportOrders"], strict=True)
        return {**fields, "transportOrders": [_with_keys(order, given) for order, given in each]}
    if "idempotency_key" in type(request).model_fields and fields.get(KEY) is None:
        return {**fields, KEY: str(uuid4())}
    return fields


def _has_keys(body: JsonValue) -> bool:
    if not isinstance(body, Mapping):
        return False
    orders = body.get("transportOrders")
    if isinstance(orders, Sequence):
        return all(map(_has_keys, orders))
    return bool(body.get(KEY))


@dataclass(slots=True)
class Addresses:
    """URLs of the order services of a fleet; the last one that was active is asked first."""

    urls: list[str]

    @classmethod
    def of(cls, urls: str | Sequence[str]) -> Addresses:
        """Return them without their trailing slashes."""
        return cls([each.rstrip("/") for each in ([urls] if isinstance(urls, str) else urls)])

    def prefer(self, url: str) -> None:
        """Ask this one first next time."""
        self.urls.sort(key=lambda each: each != url)


@dataclass(slots=True)
class Attempt:
    """One round through all order services."""

    addresses: Addresses
    call: Call
    failures: list[str] = field(default_factory=list)

    def urls(self) -> Iterator[str]:
        """Yield the URLs to ask; raises UnreachableError at their end."""
        yield from tuple(self.addresses.urls)
        raise UnreachableError("\n".join(self.failures))

    def failed(self, url: str, error: httpx.TransportError) -> None:
        """Note that an order service does not answer.

        Raises UnreachableError if it may have executed a request that must not be executed twice.
        """
        self.failures.append(f"{url}: {error}")
        if not self.call.repeatable and not isinstance(error, NOT_SENT):
            raise UnreachableError(
                f"{url}: {str(error) or type(error).__name__}; the request may have been executed"
            ) from error

    def accepts(self, url: str, answer: httpx.Response) -> bool:
        """Return whether it is the answer of the active one; raises RefusedError."""
        if answer.is_success:
            self.addresses.prefer(url)
            return True
        problem = problem_of(answer)
        if not _stands_by(problem):
            raise RefusedError(problem)
        self.failures.append(f"{url}: {problem.detail}")
        return False


def read(operation: Operation[A], answer: httpx.Response) -> A:
    """Return the body of a successful answer; raises UnreachableError if it has another form."""
    try:
        return operation.answer.model_validate_json(answer.content)
    except ValidationError as error:
        raise UnreachableError(
            f"{answer.url} answered {answer.status_code} and {_unknown_form(answer)}"
        ) from error


def next_page(after: str | None, query: Query | None) -> Query:
    """Return the query of the page after ``after``; None: of the first one."""
    return {"limit": PAGE, **(query or {}), **({"after": after} if after else {})}


def _unknown_form(answer: httpx.Response) -> str:
    """Return why a successful answer cannot be read."""
    if answer.headers.get("content-type", "").startswith("application/json"):
        return "its answer has a form that this nena does not know; is it of another release?"
    return NOT_ONE


def _stands_by(problem: Problem) -> bool:
    return problem.status == HTTPStatus.SERVICE_UNAVAILABLE and problem.title == "Standing by"


def problem_of(answer: httpx.Response) -> Problem:
    """Return the problem of an answer that is no success."""
    try:
        return Problem.model_validate_json(answer.content)
    except ValidationError:
        detail = f"{answer.url} answered {answer.status_code} and {NOT_ONE}"
        return Problem(title="No order service", status=answer.status_code, detail=detail)


@dataclass(frozen=True, slots=True)
class ServiceState:
    """State of an order service, as text, and whether it is as it should be."""

    text: str
    healthy: bool

    @classmethod
    def of(cls, answer: httpx.Response) -> ServiceState:
        """Return what ``/readyz`` reports."""
        try:
            found = Readiness.model_validate_json(answer.content)
        except ValidationError:
            return cls(NOT_ONE, healthy=False)
        if found.role == "standby":
            return cls("standby", healthy=True)
        text = ", ".join((found.role, "ready" if found.ready else "not ready", *found.problems))
        return cls(text, healthy=found.ready)


@dataclass(frozen=True, slots=True)
class Event:
    """A server-sent event."""

    kind: str
    id: str | None
    data: Any


class EventReader:
    """Reads events from parts of a stream; an incomplete one at the end is dropped."""

    def __init__(self) -> None:
        self._rest = ""
        self._fields: dict[str, str] = {}

    def read(self, part: str) -> Iterator[Event]:
        """Yield the events that this part completes."""
        *lines, self._rest = (self._rest + part).split("\n")  # JSON may contain other line separators
        for line in lines:
            name, colon, value = line.removesuffix("\r").partition(":")
            if name or colon:
                self._fields[name] = value.removeprefix(" ")
                continue
            fields, self._fields = self._fields, {}
            if "data" in fields:
                yield Event(fields.get("event", "message"), fields.get("id"), json.loads(fields["data"]))
