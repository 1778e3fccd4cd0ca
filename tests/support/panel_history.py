"""Recorded histories that the panel shows."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

from nena_status_aggregator.fleet.events import Code, Event
from nena_status_aggregator.history import database

SHIFT = Path(__file__).parents[1] / "fixtures" / "history" / "shift.jsonl"
RECORDED = datetime(2026, 1, 1, tzinfo=UTC)
"""Day of the recorded shift."""

SLIDE = """(time) => {
  const slider = document.querySelector("nena-history-page .slider");
  slider.value = time;
  slider.dispatchEvent(new Event("input"));
}"""
"""Moves the slider to a time, ms."""


def yesterday() -> datetime:
    """Return yesterday's midnight, UTC."""
    return datetime.now(UTC).replace(hour=0, minute=0, second=0, microsecond=0) - timedelta(days=1)


def recorded(folder: Path, events: list[Event]) -> tuple[str, str]:
    """Make a history with these events; return the options of an aggregator for it."""
    url = f"sqlite:///{folder / 'history.db'}"
    engine = database.make_engine(url)
    database.prepare(engine)
    database.write(engine, events)
    engine.dispose()
    return "--history.url", url


def recorded_shift(folder: Path) -> tuple[str, str]:
    """Make a history with the shift, moved to yesterday."""
    entries = [json.loads(line) for line in SHIFT.read_text(encoding="utf-8").splitlines()]
    moved = yesterday() - RECORDED
    events = [
        Event(
            datetime.fromisoformat(entry["time"]) + moved,
            Code(entry["code"]),
            entry["text"],
            entry["robot"],
            entry["order"],
            entry["values"],
        )
        for entry in entries
    ]
    return recorded(folder, events)
