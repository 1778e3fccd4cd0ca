"""The chain of the audit trail: what was done to its rows, and what the check says."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest

from nena_shared.fleet_api.audit import GENESIS, AuditEntry, AuditMark, AuditPage, ChainCheck, hash_after

Rows = list[AuditEntry]


def entry(sequence: int, previous: str, **fields: Any) -> AuditEntry:
    """Make a row that follows the one with the hash ``previous``."""
    given = {
        "sequence": sequence,
        "timestamp": datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=sequence),
        "user": "ann",
        "interface": "REST",
        "client": "",
        "operation": "withdraw",
        "objectKind": "transportOrder",
        "object": f"T-{sequence}",
        "request": '{"reason":"später"}',
        "before": "",
        "after": "",
        "result": "DONE",
        "reason": "",
        **fields,
    }
    unhashed = AuditEntry.model_validate({**given, "hash": ""})
    return unhashed.model_copy(
        update={"hash": hash_after(previous, unhashed.model_dump(mode="json", by_alias=True))}
    )


def trail(length: int) -> Rows:
    rows: Rows = []
    for number in range(1, length + 1):
        rows.append(entry(number, rows[-1].hash if rows else GENESIS))
    return rows


def mark(row: AuditEntry) -> AuditMark:
    return AuditMark(sequence=row.sequence, hash=row.hash)


def check(
    rows: Rows,
    *,
    last: AuditMark,
    deleted: AuditMark | None = None,
    expected: AuditMark | None = None,
    page: int = 2,
) -> list[str]:
    """Return what is wrong with a trail that is read in pages."""
    checking = ChainCheck(expected)
    found: list[str] = []
    parts: list[Sequence[AuditEntry]] = [rows[start : start + page] for start in range(0, len(rows), page)]
    for number, part in enumerate(parts or [()]):
        following = "more" if number + 1 < len(parts) else None
        answer = AuditPage(entries=tuple(part), next=following, deleted=deleted or AuditMark(), last=last)
        found += checking.problems(answer)
    return found


def test_untouched_trail_is_intact() -> None:
    rows = trail(5)
    assert check(rows, last=mark(rows[-1]), expected=mark(rows[2])) == []
    assert check([], last=AuditMark()) == []


def test_row_written_during_the_check_is_no_problem() -> None:
    rows = trail(5)
    assert check(rows, last=mark(rows[3])) == []


TAMPERED: dict[str, tuple[Callable[[Rows], Rows], str]] = {
    "changed": (
        lambda rows: [*rows[:2], rows[2].model_copy(update={"user": "ben"}), *rows[3:]],
        "row 3 (withdraw by ben, 2026-01-01 00:00:03 UTC) does not have the hash",
    ),
    "emptied": (
        lambda rows: [*rows[:2], rows[2].model_copy(update={"request": ""}), *rows[3:]],
        "row 3 (withdraw by ann",
    ),
    "replaced": (
        lambda rows: [*rows[:2], entry(3, rows[1].hash, user="ben"), *rows[3:]],
        "row 4 (withdraw by ann",
    ),
    "removed": (lambda rows: rows[:2] + rows[3:], "row 3 is missing: row 4 follows row 2"),
    "several removed": (lambda rows: rows[:1] + rows[4:], "rows 2 to 4 are missing: row 5 follows row 1"),
    "inserted": (
        lambda rows: [*rows[:2], entry(3, rows[1].hash, operation="resume"), *rows[2:]],
        "row 3 is out of order: it follows row 3",
    ),
    "inserted and renumbered": (
        lambda rows: [
            *rows[:2],
            entry(3, rows[1].hash),
            *(row.model_copy(update={"sequence": row.sequence + 1}) for row in rows[2:]),
        ],
        "row 4 (withdraw by ann",
    ),
    "reordered": (
        lambda rows: [*rows[:2], rows[3], rows[2], rows[4]],
        "row 3 is missing: row 4 follows row 2",
    ),
    "renumbered": (
        lambda rows: [
            *rows[:2],
            rows[3].model_copy(update={"sequence": 3}),
            rows[2].model_copy(update={"sequence": 4}),
            rows[4],
        ],
        "row 3 (withdraw by ann",
    ),
    "first removed": (lambda rows: rows[2:], "rows 1 to 2 are missing: row 3 follows row 0"),
    "last removed": (lambda rows: rows[:4], "row 5 is missing: the trail ends with row 4"),
}


@pytest.mark.parametrize(("tamper", "first"), TAMPERED.values(), ids=TAMPERED)
def test_first_row_that_was_tampered_with_is_named(tamper: Callable[[Rows], Rows], first: str) -> None:
    rows = trail(5)
    assert check(tamper(rows), last=mark(rows[-1]))[0].startswith(first)


def test_last_row_with_a_new_hash_is_found() -> None:
    rows = trail(5)
    last = mark(rows[-1])
    rows[4] = entry(5, rows[3].hash, user="ben")
    assert check(rows, last=last) == [
        f"row 5 was replaced: the row that was written last has the hash {last.hash}"
    ]


def test_trail_whose_oldest_rows_were_deleted_is_intact() -> None:
    rows = trail(5)
    assert check(rows[2:], last=mark(rows[-1]), deleted=mark(rows[1])) == []
    assert check([], last=mark(rows[-1]), deleted=mark(rows[-1])) == []


def test_rows_deleted_during_the_check_are_no_problem() -> None:
    rows, checking = trail(5), ChainCheck()
    first = AuditPage(entries=(rows[0],), next="1", deleted=AuditMark(), last=mark(rows[4]))
    second = AuditPage(entries=tuple(rows[3:]), next=None, deleted=mark(rows[2]), last=mark(rows[4]))
    assert [*checking.problems(first), *checking.problems(second)] == []


def test_more_rows_missing_than_were_deleted_is_found() -> None:
    rows = trail(5)
    assert check(rows[3:], last=mark(rows[-1]), deleted=mark(rows[1])) == [
        "row 3 is missing: row 4 follows row 2"
    ]
    wrong = AuditMark(sequence=2, hash=rows[0].hash)
    assert check(rows[2:], last=mark(rows[-1]), deleted=wrong)[0].startswith("row 3 (withdraw by ann")


def test_whole_trail_with_new_hashes_is_found_by_an_expected_row() -> None:
    """Whoever can write to the database can compute all hashes again; a hash kept elsewhere shows it."""
    rows, forged = trail(3), [entry(1, GENESIS, user="ben")]
    for number in (2, 3):
        forged.append(entry(number, forged[-1].hash))
    assert check(forged, last=mark(forged[-1])) == []
    assert check(forged, last=mark(forged[-1]), expected=mark(rows[1])) == [
        f"row 2 is not the expected one: its hash is {forged[1].hash}"
    ]
    shorter = check(rows[:1], last=mark(rows[0]), expected=mark(rows[2]))
    assert shorter == ["rows 2 to 3 are missing: the trail ends with row 1"]


def test_expected_row_that_was_deleted_is_named() -> None:
    rows = trail(5)
    last, deleted = mark(rows[-1]), mark(rows[2])
    assert check(rows[3:], last=last, deleted=deleted, expected=deleted) == []
    assert (
        "row 2 cannot be compared" in check(rows[3:], last=last, deleted=deleted, expected=mark(rows[1]))[0]
    )
    other = AuditMark(sequence=3, hash=rows[0].hash)
    assert "is not the expected one" in check(rows[3:], last=last, deleted=deleted, expected=other)[0]


def test_fields_of_newer_releases_count_for_the_hash() -> None:
    newer = entry(1, GENESIS, shift="night")
    assert newer.fits(GENESIS)
    assert not newer.model_copy(update={"shift": "day"}).fits(GENESIS)
    assert entry(1, GENESIS, shift="").hash == entry(1, GENESIS).hash, (
        "rows of older releases keep their hash"
    )


def test_mark_is_read_as_it_is_printed() -> None:
    row = mark(trail(2)[1])
    assert AuditMark.parse(str(row)) == row
    with pytest.raises(ValueError, match="use SEQUENCE:HASH"):
        AuditMark.parse("2:abc")
