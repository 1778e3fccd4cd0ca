"""Client of the order service's REST API and event stream; finds the active one of several."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import httpx
from pydantic import BaseModel, JsonValue, ValidationError

from nena_shared.fleet_api.operations import LIST_VEHICLES, Operation
from nena_shared.fleet_api.requests import OrderSequencePage, Readiness, TransportOrderPage, VehicleList
from nena_shared.fleet_api.transport_order import Problem

A = TypeVar("A", bound=BaseModel)
P = TypeVar("P", TransportOrderPage, OrderSequencePage, VehicleList)
Query = Mapping[str, str | int | Sequence[str]]

PAGE = 200
"""Items per page."""

CONNECT_SECONDS = 5.0
ANSWER_SECONDS = 30.0
"""Timeout of a request, seconds; longer than the order service waits for its store and for robots."""

SILENCE_SECONDS = 20.0
"""Seconds without data after which an event stream is broken; it has a heartbeat every five seconds."""


NOT_ONE = "is not an order service; check the URL"


class RefusedError(Exception):
    """The order service rejected a request; the text says why and what to do."""

    def __init__(self, problem: Problem) -> None:
        super().__init__("\n".join([problem.detail, *(f"- {each}" for each in problem.errors)]))
        self.problem = problem


class UnreachableError(Exception):
    """No order service answers, or none of those that answer is active."""


@dataclass(frozen=True, slots=True)
class ServiceState:
    """State of an order service, as text, and whether it is as it should be."""

    text: str
    healthy: bool


class Connection:
    """Connection to the active one of several order services, found by querying each."""

    def __init__(self, urls: Sequence[str], token: str | None) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        timeout = httpx.Timeout(ANSWER_SECONDS, connect=CONNECT_SECONDS)
        self._client = httpx.Client(headers=headers, timeout=timeout)
        self._urls = [url.rstrip("/") for url in urls]

    def close(self) -> None:
        """Close all connections."""
        self._client.close()

    def call(
        self,
        operation: Operation[A],
        name: str = "",
        *,
        query: Query | None = None,
        body: JsonValue = None,
        content: bytes | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> A:
        """Call an operation on the object of this name; raises RefusedError and UnreachableError."""
        answer = self._request(
            operation.method,
            operation.path_of(name),
            query=query,
            body=body,
            content=content,
            headers=headers,
        )
        try:
            return operation.answer.model_validate_json(answer.content)
        except ValidationError as error:
            message = f"{answer.url} answered {answer.status_code} and {_unknown_form(answer)}"
            raise UnreachableError(message) from error

    def pages(self, operation: Operation[P], query: Query) -> Iterator[P]:
        """Yield the pages of a list; raises RefusedError and UnreachableError."""
        after: str | None = None
        while True:
            more: dict[str, str | int] = {"limit": PAGE, **({"after": after} if after else {})}
            page = self.call(operation, query={**query, **more})
            yield page
            after = page.next
            if after is None:
                return

    def readiness(self) -> dict[str, ServiceState]:
        """Return the state of the order service at each URL."""
        return {url: self._state_of(url) for url in self._urls}

    def _state_of(self, url: str) -> ServiceState:
        try:
            answer = self._client.get(f"{url}/readyz")
            found = Readiness.model_validate_json(answer.content)
        except httpx.TransportError as error:
            return ServiceState(f"not reachable: {error}", healthy=False)
        except ValidationError:
            return ServiceState(NOT_ONE, healthy=False)
        if found.role == "standby":
            return ServiceState("standby", healthy=True)
        text = ", ".join((found.role, "ready" if found.ready else "not ready", *found.problems))
        return ServiceState(text, healthy=found.ready)

    @contextmanager
    def stream(self, path: str, query: dict[str, str], last_id: str | None) -> Iterator[Iterator[str]]:
        """Follow the lines of an event stream; raises as :meth:`call` does, also while it is followed."""
        headers = {"Last-Event-ID": last_id} if last_id else {}
        url = self._active()
        timeout = httpx.Timeout(SILENCE_SECONDS, connect=CONNECT_SECONDS)
        try:
            with self._client.stream(
                "GET", url + path, params=query, headers=headers, timeout=timeout
            ) as answer:
                if not answer.is_success:
                    answer.read()
                    raise RefusedError(_problem_of(answer))
                yield answer.iter_lines()
        except httpx.TransportError as error:
            message = f"{url}: {error}"
            raise UnreachableError(message) from error

    def _active(self) -> str:
        """Return the URL of the active order service; a single one counts as active."""
        if len(self._urls) > 1:
            self.call(LIST_VEHICLES, query={"limit": 1})
        return self._urls[0]

    def _request(
        self,
        method: str,
        path: str,
        *,
        query: Query | None = None,
        body: JsonValue = None,
        content: bytes | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> httpx.Response:
        failures = []
        for url in tuple(self._urls):
            try:
                answer = self._client.request(
                    method, url + path, params=query, json=body, content=content, headers=headers
                )
            except httpx.TransportError as error:
                failures.append(f"{url}: {error}")
                continue
            if answer.is_success:
                self._prefer(url)
                return answer
            problem = _problem_of(answer)
            if not _stands_by(problem):
                raise RefusedError(problem)
            failures.append(f"{url}: {problem.detail}")
        raise UnreachableError("\n".join(failures))

    def _prefer(self, url: str) -> None:
        """Try this URL first next time."""
        self._urls.remove(url)
        self._urls.insert(0, url)


def _unknown_form(answer: httpx.Response) -> str:
    """Return why a successful answer cannot be read."""
    if answer.headers.get("content-type", "").startswith("application/json"):
        return "its answer has a form that this nena does not know; is it of another release?"
    return NOT_ONE


def _stands_by(problem: Problem) -> bool:
    return problem.status == httpx.codes.SERVICE_UNAVAILABLE and problem.title == "Standing by"


def _problem_of(answer: httpx.Response) -> Problem:
    try:
        return Problem.model_validate_json(answer.content)
    except ValidationError:
        detail = f"{answer.url} answered {answer.status_code} and {NOT_ONE}"
        return Problem(title="No order service", status=answer.status_code, detail=detail)


RETRY_PAUSE = 1.0
"""Delay before reconnecting a broken stream, seconds."""


@dataclass(frozen=True, slots=True)
class Event:
    """A server-sent event."""

    kind: str
    id: str | None
    data: Any


def read_events(lines: Iterable[str]) -> Iterator[Event]:
    """Yield the events of a stream; incomplete ones are dropped."""
    fields: dict[str, str] = {}
    for line in lines:
        name, _, value = line.partition(":")
        if line:
            fields[name] = value.removeprefix(" ")
        else:
            if "data" in fields:
                yield Event(fields.get("event", "message"), fields.get("id"), json.loads(fields["data"]))
            fields = {}


def follow(
    connection: Connection, query: dict[str, str], *, on_break: Callable[[str], None] = lambda _: None
) -> Iterator[Event]:
    """Follow the events endlessly; resume after the last one when the connection breaks.

    Raises RefusedError, and UnreachableError if the first attempt fails.
    """
    last_id: str | None = None
    ever = False
    while True:
        try:
            with connection.stream("/v1/events", query, last_id) as lines:
                for event in read_events(lines):
                    ever = True
                    last_id = event.id or last_id
                    yield event
        except UnreachableError as error:
            if not ever:
                raise
            on_break(str(error))
        time.sleep(RETRY_PAUSE)
