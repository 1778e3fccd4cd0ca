"""Bounded memory of a conversation: dictionaries with a limit, and messages that wait for an answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Generic, TypeVar

from nena_conversations.message import ReceivedMessage

K = TypeVar("K")
V = TypeVar("V")

DEFAULT_LIMIT: Final = 10_000
"""Maximum number of remembered IDs of one kind; older ones are forgotten."""


class BoundedDict(dict[K, V]):
    """Dictionary that drops its oldest entry when full: a conversation may have no end."""

    def __init__(self, limit: int = DEFAULT_LIMIT) -> None:
        super().__init__()
        self._limit = limit

    def __setitem__(self, key: K, value: V) -> None:
        super().__setitem__(key, value)
        if len(self) > self._limit:
            del self[next(iter(self))]


ANSWERED_WITHIN: Final = timedelta(seconds=10)
SETTLED_AFTER: Final = timedelta(seconds=2)
"""Age from which a message needs an answer at the end of a conversation; later answers may follow the end."""
MAX_PENDING: Final = 200
"""Pending messages of one kind to one robot; beyond, the oldest is dropped."""
STATES_WITHOUT_ANSWER: Final = 3
"""After so many states without an answer, a message counts as unanswered at the end of a conversation."""


@dataclass(slots=True)
class _Pending:
    received: ReceivedMessage
    states: int = 0
    """Number of the robot's states since the message."""

    def overdue(self, now: datetime, *, ended: bool) -> bool:
        waited = now - self.received.time
        if ended and self.states >= STATES_WITHOUT_ANSWER and waited > SETTLED_AFTER:
            return True
        # Without a state the robot had no chance to answer: its silence is another finding.
        return self.states > 0 and waited > ANSWERED_WITHIN


class Unanswered(Generic[K]):
    """Messages that wait for an answer, by key."""

    def __init__(self) -> None:
        self._sent: BoundedDict[K, _Pending] = BoundedDict(MAX_PENDING)

    def add(self, key: K, received: ReceivedMessage) -> None:
        """Start waiting for the answer to a message."""
        self._sent[key] = _Pending(received)

    def on_state(self, answers: Callable[[K], bool]) -> None:
        """Remove the messages that a state answers and count it for the others."""
        for key, sent in list(self._sent.items()):
            if answers(key):
                del self._sent[key]
            else:
                sent.states += 1

    def overdue(self, now: datetime, *, ended: bool) -> Iterator[tuple[K, ReceivedMessage]]:
        """Yield, once, messages whose answer is overdue at ``now``."""
        for key, sent in list(self._sent.items()):
            if sent.overdue(now, ended=ended):
                del self._sent[key]
                yield key, sent.received
