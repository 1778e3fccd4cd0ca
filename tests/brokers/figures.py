"""The figures of each broker, kept as lines of JSON: ``brokers.table`` makes docs/brokers.md of them."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

FILE = Path(__file__).parents[2] / "build" / "brokers.jsonl"

ROWS = {
    "version": "version",
    "service first": "robots started after the order service: all ONLINE in the order service",
    "service first, aggregator": "... in the aggregator",
    "five orders": "five orders of three robots: all finished",
    "robots first": "order service with an empty store started after the robots: all ONLINE, from its answer",
    "robots first, aggregator": "... aggregator started after the robots: all ONLINE, from its answer",
    "undisturbed": "rest of an order after its pick, undisturbed",
    "order service": "order service restarted during it: order finished",
    "order service again": "... of these, until the order service answers again",
    "aggregator": "aggregator restarted during it: order finished",
    "aggregator shows": "... robots, one of them OFFLINE, and orders shown, from its answer",
    "cut": "link of the robot cut for 4 s during it: order finished",
    "broker restart": "broker restarted during it: order finished",
    "broker again": "... of these, until the broker answers again",
    "killed": "agent killed: CONNECTION_BROKEN in both, after",
    "stopped": "agent stopped, keep-alive 4 s: CONNECTION_BROKEN after",
    "names of orders": "order `WMS-2.1`: finished",
    "names of robots": "robot `robot.2`",
}
"""What each figure is, by its name; without a unit, seconds."""

Column = dict[str, str]


def read_all() -> dict[str, Column]:
    """Return the newest figures by broker."""
    found: dict[str, Column] = {}
    for line in FILE.read_text(encoding="utf-8").splitlines():
        record: Column = json.loads(line)
        found.setdefault(record.pop("broker"), {}).update(record)
    return found


class Figures:
    """The figures of one broker; each is a line."""

    def __init__(self, broker: str) -> None:
        self._broker = broker
        self.failed: dict[str, str] = {}
        """What did not come true, by the name of the figure."""

    def record(self, name: str, value: str) -> None:
        """Write one figure."""
        assert name in ROWS, name
        record = {"broker": self._broker, name: value, "date": datetime.now(UTC).date().isoformat()}
        record["load"] = f"{os.getloadavg()[0]:.1f}"
        FILE.parent.mkdir(exist_ok=True)
        with FILE.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(record) + "\n")

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Record the seconds that the block takes, or that it fails; the test goes on."""
        began = time.monotonic()
        try:
            yield
        except AssertionError as error:
            self.failed[name] = str(error)
            self.record(name, f"**failed** ({time.monotonic() - began:.0f} s)")
        else:
            self.record(name, f"{time.monotonic() - began:.1f}")
