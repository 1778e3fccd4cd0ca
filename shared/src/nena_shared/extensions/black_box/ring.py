"""The last minutes of messages, in memory, limited by age and size."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Final, NamedTuple

ENTRY_OVERHEAD: Final = 200
"""Memory of an entry besides its payload, bytes."""
DOCUMENT_SIZE: Final = 600
"""Estimated memory of a payload that is not encoded yet, without the items of its sequences, bytes."""
ITEM_SIZE: Final = 8
"""Memory of an item of a sequence, bytes: the names of points exist anyway."""
LARGEST_SHARE: Final = 4
"""An entry may take at most a quarter of the ring, so that a large map does not replace all messages."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A source of entries, which becomes a topic of the file."""

    topic: str
    schema: str = ""
    """ROS message type, such as ``sensor_msgs/msg/Imu``, of payloads in CDR; empty: JSON."""
    own: bool = True
    """Whether this program has made the payloads, so that they are valid."""


Payload = bytes | Mapping[str, object]
"""Bytes, or a document that is encoded as JSON in the file; it must not change."""


class Entry(NamedTuple):
    """A recorded payload."""

    at: float
    """Time of recording, monotonic, s."""
    channel: Channel
    payload: Payload

    cost: int = 0
    """Memory of the entry, bytes."""


def _cost_of(payload: Payload) -> int:
    if isinstance(payload, bytes):
        return ENTRY_OVERHEAD + len(payload)
    cost = ENTRY_OVERHEAD + DOCUMENT_SIZE
    for each in payload.values():
        if type(each) is tuple:  # isinstance takes longer, and counts here
            cost += ITEM_SIZE * len(each)
    return cost


class Ring:
    """Keeps references to payloads that exist anyway; nothing is copied or encoded. Thread-safe.

    An entry is removed when it is older than ``seconds``, or when newer ones need its space.
    """

    def __init__(self, *, seconds: float, limit: int) -> None:
        """Create an empty ring of at most ``limit`` bytes."""
        self._seconds = seconds
        self._limit = limit
        self._entries: deque[Entry] = deque()
        self._size = 0
        self._lock = Lock()
        self.too_large = 0
        """Number of entries left out because of their size."""
        self.displaced = 0
        """Number of entries removed for newer ones before their time."""

    @property
    def size(self) -> int:
        """Return the memory of all entries, bytes."""
        return self._size

    def add(self, channel: Channel, payload: Payload, now: float) -> None:
        """Add a payload at ``now`` (monotonic, s)."""
        cost = _cost_of(payload)
        with self._lock:
            if cost * LARGEST_SHARE > self._limit:
                self.too_large += 1
                return
            self._entries.append(Entry(now, channel, payload, cost))
            self._size += cost
            if self._size > self._limit or self._entries[0].at < now - self._seconds:
                self._drop_old(now)

    def entries(self, now: float) -> list[Entry]:
        """Return the entries that are not too old at ``now``, oldest first."""
        with self._lock:
            self._drop_old(now)
            return list(self._entries)

    def _drop_old(self, now: float) -> None:
        entries, oldest = self._entries, now - self._seconds
        while entries and (self._size > self._limit or entries[0].at < oldest):
            removed = entries.popleft()
            self._size -= removed.cost
            self.displaced += removed.at >= oldest
