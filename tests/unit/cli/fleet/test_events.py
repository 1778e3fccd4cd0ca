from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice

import pytest

from nena_cli.fleet import events
from nena_cli.fleet.connection import Connection, NotReachedError
from nena_cli.fleet.events import Event, follow, read_events

STREAM = """\
retry: 1000

id: 3
event: transportOrder
data: {"name": "T-1"}

event: heartbeat
data: {}

id: 4
event: synced
data: {}
"""


def test_events_are_read_and_half_an_event_is_none() -> None:
    assert list(read_events(STREAM.split("\n"))) == [
        Event("transportOrder", "3", {"name": "T-1"}),
        Event("heartbeat", None, {}),
        Event("synced", "4", {}),
    ]
    assert list(read_events(["event: synced", "data: {}"])) == []


class Breaking(Connection):
    """Its streams break after what the test gives them."""

    def __init__(self, *streams: list[str] | None) -> None:
        super().__init__(["http://127.0.0.1:1"], None)
        self._streams = iter(streams)
        self.asked: list[str | None] = []

    @contextmanager
    def stream(self, _path: str, _query: dict[str, str], last_id: str | None) -> Iterator[Iterator[str]]:
        self.asked.append(last_id)
        lines = next(self._streams)
        if lines is None:
            raise NotReachedError("away")
        yield iter(lines)


def test_a_broken_stream_is_taken_up_behind_the_last_event(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "RETRY_PAUSE", 0.0)
    connection = Breaking(STREAM.split("\n"), None, STREAM.split("\n"))
    told: list[str] = []
    kinds = [each.kind for each in islice(follow(connection, {}, on_break=told.append), 6)]
    assert kinds == ["transportOrder", "heartbeat", "synced"] * 2
    assert connection.asked == [None, "4", "4"]
    assert told == ["away"]


def test_nobody_there_at_the_first_try_is_an_error() -> None:
    with pytest.raises(NotReachedError):
        next(follow(Breaking(None), {}))
