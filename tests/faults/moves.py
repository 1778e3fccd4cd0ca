"""Where a loopback robot was, by its own record: an edge agent that writes its poses into a file.

What a robot does during an outage, nobody else hears. Run it as
``python -m faults.moves RECORD nena-edge-agent OPTIONS``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from nena_edge_agent import __main__ as program
from nena_edge_agent import drivers
from nena_edge_agent.driver.port import PoseReport
from nena_edge_agent.loopback.driver import LoopbackDriver
from support.programs import Program

TESTS = Path(__file__).parents[1]

Sample = tuple[float, float, float]
"""Monotonic seconds, which all programs of a machine share, and x and y in m."""


def watched_agent(record: Path, *options: str, log: Path) -> Program:
    """Start an edge agent that adds its poses to ``record``."""
    before = (sys.executable, "-m", "faults.moves", str(record))
    environment: Mapping[str, str] = {"PYTHONPATH": str(TESTS)}
    return Program("nena-edge-agent", *options, log=log, before=before, environment=environment)


def read_moves(record: Path) -> list[Sample]:
    """Return the record so far; a line that is being written is left out."""
    lines = record.read_text(encoding="utf-8").split("\n")[:-1] if record.exists() else []
    return [(float(at), float(x), float(y)) for at, x, y in map(str.split, lines)]


def longest_standstill(moves: Sequence[Sample], start: float) -> float:
    """Return the longest time in which the place did not change, from ``start`` to the last move, seconds."""
    changes = [later[0] for sooner, later in pairwise(moves) if later[1:] != sooner[1:]]
    return max(
        (to - since for since, to in pairwise([start, *(at for at in changes if at > start)])), default=0.0
    )


def _recording(record: Path) -> Callable[..., LoopbackDriver]:
    def make(*arguments: Any, emit: Callable[[object], None], **named: Any) -> LoopbackDriver:
        lines = record.open("a", buffering=1, encoding="utf-8")

        def note(event: object) -> None:
            if isinstance(event, PoseReport):
                lines.write(f"{time.monotonic()} {event.pose.x:.3f} {event.pose.y:.3f}\n")
            emit(event)

        return LoopbackDriver(*arguments, emit=note, **named)

    return make


if __name__ == "__main__":
    drivers.LoopbackDriver = _recording(Path(sys.argv[1]))  # type: ignore[assignment,attr-defined]
    sys.exit(program.main(sys.argv[3:]))
