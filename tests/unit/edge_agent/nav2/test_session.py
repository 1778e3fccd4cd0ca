from __future__ import annotations

import threading
from collections.abc import Callable

from nena_edge_agent.nav2.session import RosMailbox


class Loop:
    """Functions that wait to be called, as an event loop keeps them."""

    def __init__(self) -> None:
        self.posted: list[Callable[[], None]] = []

    def run(self) -> None:
        while self.posted:
            self.posted.pop(0)()


def test_items_come_in_order_with_one_call_for_all_that_wait() -> None:
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


def test_nothing_stays_behind_while_two_threads_are_at_it() -> None:
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
