"""Writes docs/compatibility.md: how robots deviate from VDA 5050, and what becomes of each."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Final

from support.deviating_robots import DEVIATIONS, Deviation
from support.markdown import row

_HERE: Final = Path(__file__).parent
DOCUMENT: Final = _HERE.parents[1] / "docs" / "compatibility.md"


def document() -> str:
    """Return the whole text."""
    counted = Counter(map(_outcome, DEVIATIONS))
    summary = ", ".join(f"{count} {outcome}" for outcome, count in counted.most_common())
    head = ("the robot sends", "version", "outcome", "reported as", "`reason`", "seen in public")
    table = [row(head), row("---" for _ in head), *map(_row, DEVIATIONS)]
    text = (_HERE / "compatibility_introduction.md").read_text(encoding="utf-8")
    peers = (_HERE / "compatibility_peers.md").read_text(encoding="utf-8")
    return "\n".join([text + f"{len(DEVIATIONS)} deviations: {summary}.", "", *table, peers])


def _outcome(deviation: Deviation) -> str:
    if deviation.refusal:
        return "get no order"
    return "work with a report" if deviation.report else "work"


def _row(deviation: Deviation) -> str:
    report = f"`{deviation.report.strip()}`" if deviation.report else ""
    refusal = f"{deviation.refusal.rstrip(': ')} ..." if deviation.refusal else ""
    cells = (deviation.words, deviation.version, _outcome(deviation), report, refusal, deviation.seen)
    return row(cells)


if __name__ == "__main__":
    DOCUMENT.write_text(document(), encoding="utf-8")
