"""What of a recording is published again, when, and under which headers: all but the publishing itself."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Final

from pydantic_core import from_json, to_json

from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.said import Speaker, speaker_of
from nena_shared.mqtt.topic_filter import matches
from nena_shared.vda5050.topics import Topic

LONGEST_PAUSE: Final = 60.0
"""Seconds between two messages of a replay, at most: nobody waits a night for a robot that slept."""
KEPT: Final = (Topic.CONNECTION, Topic.FACTSHEET)
"""Topics that robots publish retained; a recording cannot show it of messages that came live."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Which messages are meant; nothing given: all of them."""

    speaker: Speaker | None = None
    topic_filters: tuple[str, ...] = ()

    def takes(self, entry: Entry) -> bool:
        """Tell whether a message is one of them."""
        if self.speaker and speaker_of(entry.topic) is not self.speaker:
            return False
        return not self.topic_filters or any(matches(each, entry.topic) for each in self.topic_filters)


def paced(entries: Iterable[Entry], speed: float) -> Iterator[tuple[float, Entry]]:
    """Give each message with the seconds to wait before it: those of the recording, divided by ``speed``."""
    last: datetime | None = None
    for entry in entries:
        pause = (entry.time - last).total_seconds() / speed if last else 0.0
        last = entry.time
        yield min(max(pause, 0.0), LONGEST_PAUSE), entry


def is_kept(topic: str) -> bool:
    """Tell whether a message of this topic is published retained."""
    return topic.rsplit("/", 1)[-1] in KEPT


class FreshHeaders:
    """Counts headerId anew for each topic, and tells the present time."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()

    def renewed(self, entry: Entry, now: datetime) -> Entry:
        """Give the message under a new header; what has no header stays as it is."""
        try:
            content = from_json(entry.payload)
        except ValueError:
            return entry
        if not isinstance(content, dict) or "headerId" not in content:
            return entry
        timestamp = now.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        header = {"headerId": self._counts[entry.topic], "timestamp": timestamp}
        self._counts[entry.topic] += 1
        return replace(entry, payload=to_json(content | header))
