"""A bounded way from the ROS thread into the event loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Takes plain data in one thread and hands it to ``deliver`` in another, in order.

    ``post`` has a function called in the other thread. When more than ``limit`` items wait, the oldest is
    dropped: every topic that is read tells a state, of which the newest counts.
    """

    def __init__(
        self, limit: int, deliver: Callable[[T], None], post: Callable[[Callable[[], None]], None]
    ) -> None:
        self._items: deque[T] = deque(maxlen=limit)
        self._lock = threading.Lock()
        self._posted = False
        self._deliver = deliver
        self._post = post

    def put(self, item: T) -> None:
        """Leave an item; returns at once."""
        with self._lock:
            self._items.append(item)
            post, self._posted = not self._posted, True
        if post:
            self._post(self._empty)

    def _empty(self) -> None:
        with self._lock:
            items = list(self._items)
            self._items.clear()
            self._posted = False
        for item in items:
            self._deliver(item)
