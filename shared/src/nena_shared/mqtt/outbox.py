"""Queue of messages to the broker, with at most one status per retained topic."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterator
from itertools import count

from nena_shared.mqtt.message import Outbound

_Key = str | int | tuple[str]
"""A retained topic, the same in a tuple for its clearing message, or the number of any other message."""


class Outbox:
    """A queue with a defined overflow rule.

    - A retained message replaces the queued one of its topic, at the same position. It is never dropped: the
      queue holds at most one status and one clearing message per topic.
    - A message that clears a topic comes after the last status of that topic, so that subscribers still see
      how an order ended.
    - At most ``limit`` other messages are queued; beyond, a new one replaces the oldest.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._waiting: OrderedDict[_Key, Outbound] = OrderedDict()
        self._numbers = count()
        self._droppable: deque[int] = deque()
        """Keys of messages that are not retained, oldest first."""

    def __len__(self) -> int:
        return len(self._waiting)

    def __iter__(self) -> Iterator[Outbound]:
        return iter(self._waiting.values())

    def add(self, message: Outbound) -> Outbound | None:
        """Append a message; return the message dropped for it, if any."""
        if not message.retain:
            return self._add_droppable(message)
        if message.payload:
            self._waiting.pop((message.topic,), None)
            self._waiting[message.topic] = message
        else:
            self._waiting[message.topic,] = message
        return None

    def pop(self) -> Outbound:
        """Remove and return the oldest message.

        Raises:
            KeyError: the queue is empty.

        """
        key, message = self._waiting.popitem(last=False)
        if isinstance(key, int):
            self._droppable.popleft()
        return message

    def clear(self) -> None:
        """Remove all messages."""
        self._waiting.clear()
        self._droppable.clear()

    def _add_droppable(self, message: Outbound) -> Outbound | None:
        dropped = None
        if len(self._droppable) >= self._limit:
            dropped = self._waiting.pop(self._droppable.popleft())
        number = next(self._numbers)
        self._waiting[number] = message
        self._droppable.append(number)
        return dropped
