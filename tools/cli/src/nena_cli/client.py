"""The REST API of the order service: the active one of several, with problems as they are told."""

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
from nena_shared.fleet_api.requests import OrderSequencePage, TransportOrderPage, VehicleList
from nena_shared.fleet_api.transport_order import Problem

A = TypeVar("A", bound=BaseModel)
P = TypeVar("P", TransportOrderPage, OrderSequencePage, VehicleList)
Query = Mapping[str, str | int | Sequence[str]]

PAGE = 200
"""Things of a list that are asked for at a time."""

CONNECT_SECONDS = 5.0
ANSWER_SECONDS = 30.0
"""More than the order service waits for its store and for robots."""

SILENCE_SECONDS = 20.0
"""An event stream that says nothing for so long is broken: it has a heartbeat each five seconds."""


class RefusedError(Exception):
    """The order service has refused a request; the text says why, and what to do."""

    def __init__(self, problem: Problem) -> None:
        super().__init__("\n".join([problem.detail, *(f"- {each}" for each in problem.errors)]))
        self.problem = problem


class NotReachedError(Exception):
    """No order service answers, or none of those that do is the active one."""


class Connection:
    """Asks the active one of several order services; which one that is, it finds out by asking."""

    def __init__(self, urls: Sequence[str], token: str | None) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        timeout = httpx.Timeout(ANSWER_SECONDS, connect=CONNECT_SECONDS)
        self._client = httpx.Client(headers=headers, timeout=timeout)
        self._urls = [url.rstrip("/") for url in urls]

    def close(self) -> None:
        """End all connections."""
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
        """Ask for an operation on the object of this name; raises RefusedError and NotReachedError."""
        answer = self._request(
            operation.method,
            operation.path_of(name),
            query=query,
            body=body,
            content=content,
            headers=headers,
        )
        return operation.answer.model_validate_json(answer.content)

    def pages(self, operation: Operation[P], query: Query) -> Iterator[P]:
        """Return the pages of a list, one after the other; raises RefusedError and NotReachedError."""
        after: str | None = None
        while True:
            more: dict[str, str | int] = {"limit": PAGE, **({"after": after} if after else {})}
            page = self.call(operation, query={**query, **more})
            yield page
            after = page.next
            if after is None:
                return

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
            raise NotReachedError(message) from error

    def _active(self) -> str:
        """Give the one that is active; with one alone it is taken to be that."""
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
        raise NotReachedError("\n".join(failures))

    def _prefer(self, url: str) -> None:
        """Ask this one first next time."""
        self._urls.remove(url)
        self._urls.insert(0, url)


def _stands_by(problem: Problem) -> bool:
    return problem.status == httpx.codes.SERVICE_UNAVAILABLE and problem.title == "Standing by"


def _problem_of(answer: httpx.Response) -> Problem:
    try:
        return Problem.model_validate_json(answer.content)
    except ValidationError:
        detail = f"{answer.url} answers {answer.status_code}, which no order service does; is the URL right?"
        return Problem(title="No order service", status=answer.status_code, detail=detail)


RETRY_PAUSE = 1.0
"""Seconds before a broken stream is taken up again."""


@dataclass(frozen=True, slots=True)
class Event:
    """One event."""

    kind: str
    id: str | None
    data: Any


def read_events(lines: Iterable[str]) -> Iterator[Event]:
    """Give the events of a stream; what is not said in full is left out."""
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
    """Follow the events for ever; after a break it goes on behind the last one.

    Raises RefusedError, and NotReachedError where nobody answers at the first try.
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
        except NotReachedError as error:
            if not ever:
                raise
            on_break(str(error))
        time.sleep(RETRY_PAUSE)
