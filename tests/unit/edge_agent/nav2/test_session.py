from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, cast

import pytest

from nena_edge_agent.driver.port import SessionState
from nena_edge_agent.nav2 import session
from nena_edge_agent.nav2.session import LateClient, RosMailbox, RosSession


class Loop:
    """Functions that wait to be called, as an event loop keeps them."""

    def __init__(self) -> None:
        self.posted: list[Callable[[], None]] = []

    def run(self) -> None:
        while self.posted:
            self.posted.pop(0)()


def test_items_are_delivered_in_order_with_one_call_for_all_waiting_ones() -> None:
    loop, came = Loop(), list[int]()
    mailbox = RosMailbox[int](10, came.append, loop.posted.append)
    for item in (1, 2, 3):
        mailbox.put(item)
    assert len(loop.posted) == 1
    loop.run()
    assert came == [1, 2, 3]


def test_the_oldest_is_dropped_when_it_is_full() -> None:
    loop, came = Loop(), list[int]()
    mailbox = RosMailbox[int](2, came.append, loop.posted.append)
    for item in (1, 2, 3):
        mailbox.put(item)
    loop.run()
    assert came == [2, 3]


def test_no_item_is_lost_between_two_threads() -> None:
    loop, came = Loop(), list[int]()
    mailbox = RosMailbox[int](1, came.append, loop.posted.append)

    def fill() -> None:
        for item in range(20_000):
            mailbox.put(item)

    filler = threading.Thread(target=fill)
    filler.start()
    while filler.is_alive():
        loop.run()
    loop.run()
    assert came[-1] == 19_999
    assert came == sorted(set(came))


class Discovery:
    """A session whose client has found its server at a certain look."""

    state = SessionState.ACTIVE

    def __init__(self, found_at: int) -> None:
        self.found_at, self.looks = found_at, 0
        self.client = LateClient(cast("RosSession", self), lambda: self)

    def service_is_ready(self) -> bool:
        self.looks += 1
        return self.looks >= self.found_at

    async def call(self, client: Any, request: str, *, seconds: float) -> str | None:
        assert (client, seconds > 0) == (self, True)
        return f"answer to {request}" if self.looks >= self.found_at else None


async def test_a_new_client_searches_for_its_server_as_long_as_a_call_may_take(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(session, "LOOK_PERIOD", 0.0)
    discovery = Discovery(found_at=200)
    assert await discovery.client.call("it", seconds=10.0) == "answer to it"


async def test_a_server_that_is_missing_is_searched_for_once() -> None:
    discovery = Discovery(found_at=10_000)
    assert await discovery.client.call("it", seconds=0.05) is None
    looks = discovery.looks
    assert await discovery.client.call("it", seconds=0.05) is None
    assert discovery.looks == looks + 1
