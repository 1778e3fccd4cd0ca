from __future__ import annotations

from pathlib import Path

from faults.footprint import Footprint
from faults.recovery import Fault, Record, read_all
from faults.table import document

SMALL, LARGE = Footprint(100.0, 20, 5), Footprint(112.0, 19, 6)


def record(test: str, *seconds: float, failed: int = 0) -> Record:
    return Record(
        test=test,
        undisturbed=1.5,
        faults=tuple(Fault("broker killed", each) for each in seconds),
        orders=30,
        failed=failed,
        robots=8,
        before={"order-service": SMALL},
        after={"order-service": LARGE},
        load=2.0,
        date="2026-11-21",
    )


def test_the_newest_record_of_each_test_counts(tmp_path: Path) -> None:
    file = tmp_path / "build" / "recovery.jsonl"
    for each in (record("a", 1.0), record("b", 2.0), record("a", 3.0)):
        each.append_to(file)

    assert read_all(file) == [record("a", 3.0), record("b", 2.0)]


def test_each_fault_has_a_line_with_its_times() -> None:
    text = document([record("a", 1.0, 9.0, 2.0), record("b", 4.0, failed=2)])

    assert "| broker killed | 8 | 3 | 2.0 | 9.0 | 1.5 | `a` |" in text
    assert "| broker killed | 8 | 1 | 4.0 | 4.0 | 1.5 | `b` |" in text
    assert "2 sites, 60 orders, 4 faults" in text
    assert "2 ended with a reason" in text


def test_programs_are_listed_with_their_growth() -> None:
    assert "| order-service | 112 | +12 | 19 | -1 | 6 | +1 |" in document([record("a", 1.0)])
