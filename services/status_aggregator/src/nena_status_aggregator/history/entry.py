"""One entry of the history as it is read, and which ones are wanted."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from typing_extensions import TypedDict

from nena_status_aggregator.fleet_model.happening import Code, Values


class HistoryEntry(TypedDict):
    """A happening, and its number: the later one has the greater."""

    id: int
    time: str
    code: str
    robot: str | None
    order: str | None
    text: str
    values: Values


@dataclass(frozen=True, slots=True)
class HistoryFilter:
    """Which entries are wanted; None and empty: all."""

    robot: str | None = None
    order: str | None = None
    codes: tuple[Code, ...] = ()
    """Empty: all but the positions, which are many."""
    since: datetime | None = None
    """From this time on."""
    until: datetime | None = None
    """Before this time."""
