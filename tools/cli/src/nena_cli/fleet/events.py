"""Server-sent events, followed over breaks of the connection."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from nena_cli.fleet.connection import Connection, NotReachedError

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
