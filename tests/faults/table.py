"""Write docs/recovery.md: the results of the last full run of the fault tests."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from statistics import median

from faults import standstill
from faults.footprint import Footprint
from faults.recovery import FILE, Record, read_all
from support.markdown import row

DOCUMENT = Path(__file__).parents[2] / "docs" / "recovery.md"
INTRODUCTION = Path(__file__).with_name("introduction.md")
STANDSTILLS = Path(__file__).with_name("standstill.md")
HEADING = STANDSTILLS.read_text(encoding="utf-8").partition("\n")[0]


def document(records: Iterable[Record]) -> str:
    """Return the text of the page."""
    found = list(records)
    dates = sorted({each.date for each in found})
    loads = [each.load for each in found]
    times = f"{dates[0]} to {dates[-1]}" if len(dates) > 1 else dates[0]
    said = (
        f"Run on {times} on a machine with a load of {min(loads)} to {max(loads)}: "
        f"{len(found)} sites, {sum(each.orders for each in found)} orders, "
        f"{sum(len(each.faults) for each in found)} faults. **No order was lost or done twice. "
        f"No program exited or grew without bound.** {_failures(found)}"
    )
    parts = [INTRODUCTION.read_text(encoding="utf-8"), said, "", *_faults(found), "", *_programs(found), ""]
    return "\n".join(parts)


def standstills(found: Iterable[standstill.Standstill]) -> Iterator[str]:
    """Yield the section about the robot whose order is in work."""
    yield STANDSTILLS.read_text(encoding="utf-8").rstrip("\n")
    yield ""
    yield from standstill.table(found)
    yield ""


def _failures(found: Iterable[Record]) -> str:
    failed = sum(each.failed for each in found)
    if not failed:
        return ""
    return f"Of the orders, {failed} ended with a reason, unfinished: robots were replaced or duplicated."


def _faults(found: Iterable[Record]) -> Iterator[str]:
    yield row(["Fault", "Robots", "Times", "Recovery, s: median", "longest", "Undisturbed, s", "Test"])
    yield row(["---"] * 7)
    for record in found:
        faults = sorted(record.faults, key=lambda each: each.name)
        for name, group in groupby(faults, key=lambda each: each.name):
            seconds = [each.seconds for each in group]
            figures = (len(seconds), round(median(seconds), 1), max(seconds), record.undisturbed)
            yield row([name, str(record.robots), *map(str, figures), f"`{record.test}`"])


def _programs(found: Iterable[Record]) -> Iterator[str]:
    """Show the largest growth of each program, whatever the test."""
    yield (
        "Resource use of each program at the end of a test, and its growth since the site was at work "
        "(maximum of all tests):"
    )
    yield ""
    yield row(["Program", "MB", "grown", "Descriptors", "grown", "Threads", "grown"])
    yield row(["---"] * 7)
    pairs = sorted(_pairs(found), key=lambda each: each[0])
    for name, group in groupby(pairs, key=lambda each: each[0]):
        yield row([name, *_growth([(before, after) for _, before, after in group])])


def _pairs(found: Iterable[Record]) -> Iterator[tuple[str, Footprint, Footprint]]:
    for record in found:
        for name in record.before.keys() & record.after.keys():
            yield name, record.before[name], record.after[name]


def _growth(pairs: list[tuple[Footprint, Footprint]]) -> Iterator[str]:
    for measure in ("megabytes", "descriptors", "threads"):
        values = [(getattr(before, measure), getattr(after, measure)) for before, after in pairs]
        yield f"{max(after for _, after in values):.0f}"
        yield f"{max(after - before for before, after in values):+.0f}"


if __name__ == "__main__":
    written = DOCUMENT.read_text(encoding="utf-8").partition(HEADING)[0]
    first = document(read_all(FILE)) if FILE.exists() else written.rstrip("\n") + "\n"
    second = standstills(standstill.read_all(standstill.FILE))
    DOCUMENT.write_text("\n".join([first, *second]), encoding="utf-8")
