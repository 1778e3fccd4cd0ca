"""What fleet control has sent and the robot has to answer by its state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Generic, TypeVar

from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.said import Said

K = TypeVar("K")

ANSWERED_WITHIN: Final = timedelta(seconds=10)
SETTLED_AFTER: Final = timedelta(seconds=2)
"""At the end of a conversation; what was sent later may have been answered after it."""
WAITING: Final = 200
"""Messages of one kind to one robot that are waited for; at a silent robot the oldest are let go."""
CHANCES: Final = 3
"""States of a robot up to the end of a conversation that do not answer a message: it is not answered."""


@dataclass(slots=True)
class _Sent:
    said: Said
    states: int = 0
    """States of the robot since then."""

    def overdue(self, now: datetime, *, ended: bool) -> bool:
        waited = now - self.said.time
        if ended and self.states >= CHANCES and waited > SETTLED_AFTER:
            return True
        return self.states > 0 and waited > ANSWERED_WITHIN


class Unanswered(Generic[K]):
    """Messages that wait for an answer, by what names them."""

    def __init__(self) -> None:
        self._sent: Remembered[K, _Sent] = Remembered(WAITING)

    def add(self, key: K, said: Said) -> None:
        """Wait for an answer from now on."""
        self._sent[key] = _Sent(said)

    def state_came(self, answers: Callable[[K], bool]) -> None:
        """Strike out what a state answers, and count it as a chance for the rest."""
        for key, sent in list(self._sent.items()):
            if answers(key):
                del self._sent[key]
            else:
                sent.states += 1

    def overdue(self, now: datetime, *, ended: bool) -> Iterator[tuple[K, Said]]:
        """Give once what should have been answered before ``now``."""
        for key, sent in list(self._sent.items()):
            if sent.overdue(now, ended=ended):
                del self._sent[key]
                yield key, sent.said
