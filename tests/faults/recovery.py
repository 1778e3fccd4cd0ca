"""What a trial found, kept as a line of JSON: ``faults.table`` makes docs/recovery.md of these."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from faults.footprint import Footprint

FILE = Path(os.environ.get("NENA_FAULTS_RECORD", Path(__file__).parents[2] / "build" / "recovery.jsonl"))


@dataclass(frozen=True, slots=True)
class Fault:
    """One of a trial."""

    name: str
    seconds: float
    """From its end until two further orders had ended."""

    def __str__(self) -> str:
        return f"{self.name} {self.seconds} s"


@dataclass(frozen=True, slots=True)
class Record:
    """What became of a site under one kind of fault."""

    test: str
    undisturbed: float
    """Seconds that two orders took to come to their end before the first fault."""
    faults: tuple[Fault, ...]
    orders: int
    failed: int
    """How many of these ended with a reason, for the fault."""
    robots: int
    before: Mapping[str, Footprint] = field(default_factory=dict)
    """By program, when all was well."""
    after: Mapping[str, Footprint] = field(default_factory=dict)
    load: float = field(default_factory=lambda: round(os.getloadavg()[0], 1))
    """Of the machine in the last minute."""
    date: str = field(default_factory=lambda: datetime.now(UTC).date().isoformat())

    def append_to(self, file: Path) -> None:
        """Add it to what earlier trials have found."""
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(asdict(self)) + "\n")

    @classmethod
    def read(cls, line: str) -> Self:
        """Read what :meth:`append_to` has written."""
        found: dict[str, Any] = json.loads(line)
        for moment in ("before", "after"):
            found[moment] = {name: Footprint(**each) for name, each in found[moment].items()}
        found["faults"] = tuple(Fault(**each) for each in found["faults"])
        return cls(**found)


def read_all(file: Path) -> list[Record]:
    """Return the newest record of each test, in the order of the tests' first ones."""
    newest: dict[str, Record] = {}
    for line in file.read_text(encoding="utf-8").splitlines():
        record = Record.read(line)
        newest[record.test] = record
    return list(newest.values())
