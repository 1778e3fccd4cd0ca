"""Find the message at which a broker ends the connection, so that it is not sent again for ever."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

ENDS: Final = 2
"""Number of connections that must end at a message, or at a subscription, before it counts as refused."""

SUSPECTS_LIMIT: Final = 1000


class Suspects:
    """Topics whose messages may be the reason why connections have ended.

    A broker that refuses a message either acknowledges it or ends the connection, without a reason (MQTT
    3.1.1 section 3.3.5). Connections end for other reasons as well, so all messages in flight at the end are
    only suspects. On the next connection, the link sends each of them alone, and waits for its
    acknowledgement, which clears it. A message is refused if :data:`ENDS` connections have ended while it was
    alone in flight, the last one after it had stood for a while: a broker that crashes again and again, or a
    cable that is cut, acknowledges it in between.

    Topics stand for messages, because statuses and commands are sent again with other content.
    """

    def __init__(self) -> None:
        self._ends: dict[str, int] = {}
        """By suspected topic, the number of connections that have ended while it was alone in flight."""

    def __len__(self) -> int:
        return len(self._ends)

    def __contains__(self, topic: str) -> bool:
        return topic in self._ends

    def near_refusal(self, topic: str) -> bool:
        """Return whether the next end of a connection at this topic shows that it is refused."""
        return self._ends.get(topic, 0) == ENDS - 1

    def add_refused(self, topic: str) -> None:
        """Suspect a topic that was refused before: one more end of a connection shows that it still is."""
        self._ends[topic] = ENDS - 1

    def clear(self, topic: str) -> None:
        """Remove a topic: the broker has accepted a message on it."""
        self._ends.pop(topic, None)

    def note_end(self, in_flight: Collection[str], *, alone: bool) -> str | None:
        """Suspect the topics in flight at the end of a connection; return the one that is refused, if any.

        It is no longer a suspect then. ``alone``: one message was in flight, with an acknowledgement due.
        """
        for topic in in_flight:
            ends = self._ends.pop(topic, 0) + alone
            if ends >= ENDS:
                return topic
            self._ends[topic] = ends
        while len(self._ends) > SUSPECTS_LIMIT:
            del self._ends[next(iter(self._ends))]
        return None
