"""How long a robot stood in the middle of its order, by broker and fault, kept as lines of JSON."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from support.markdown import row

FILE = Path(__file__).parents[2] / "build" / "standstill.jsonl"
BEYOND = 2.0
"""Seconds that a robot may stand after the outage."""


@dataclass(frozen=True, slots=True)
class Standstill:
    """What one fault did to the robot whose order was in work; seconds."""

    broker: str
    fault: str
    outage: float
    """From its start until the part answered, or the link was whole."""
    stood: float
    """The robot's longest standstill."""
    beyond: float
    """Its longest standstill after the end of the outage."""
    load: float = field(default_factory=lambda: round(os.getloadavg()[0], 1))
    """Of the machine in the last minute."""
    date: str = field(default_factory=lambda: datetime.now(UTC).date().isoformat())

    def append_to(self, file: Path) -> None:
        """Add it to the earlier ones."""
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(asdict(self)) + "\n")


def read_all(file: Path) -> list[Standstill]:
    """Return the newest of each broker and fault; none if there is no file."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    newest = {(each.broker, each.fault): each for each in (Standstill(**json.loads(line)) for line in lines)}
    return list(newest.values())


def table(found: Iterable[Standstill]) -> Iterator[str]:
    """Show a row for each fault, a column for each broker."""
    by_fault: dict[str, dict[str, Standstill]] = {}
    for each in found:
        by_fault.setdefault(each.fault, {})[each.broker] = each
    every = [each for faults in by_fault.values() for each in faults.values()]
    brokers = list(dict.fromkeys(each.broker for each in every))
    yield row(["Fault", *brokers])
    yield row(["---"] * (len(brokers) + 1))
    for fault, by_broker in by_fault.items():
        cells = (by_broker.get(broker) for broker in brokers)
        shown = (f"{each.outage} / {each.stood} / {each.beyond}" if each else "not run" for each in cells)
        yield row([fault, *shown])
    if every:
        dates, loads = {each.date for each in every}, [each.load for each in every]
        yield ""
        when = " and ".join(sorted(dates))
        yield f"Run on {when} on a machine with a load of {min(loads)} to {max(loads)}."
