from __future__ import annotations

import csv
import json
from io import StringIO

import pytest

from nena_status_aggregator.history.database import HistoryEntry
from nena_status_aggregator.history.history import as_csv, as_json_lines, csv_head


def entry(text: str = "Ready.", robot: str | None = "ACME/r1") -> HistoryEntry:
    return {
        "id": 7,
        "time": "2026-01-01T00:00:00.000Z",
        "code": "condition",
        "robot": robot,
        "order": None,
        "text": text,
        "values": {"condition": "IDLE"},
    }


def read(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(text, newline="")))


def test_csv_is_read_back_whatever_the_text_holds() -> None:
    odd = 'He said "no",\r\nthen; went.'
    (row,) = read(csv_head() + as_csv([entry(odd)]))
    assert row == {
        "id": "7",
        "time": "2026-01-01T00:00:00.000Z",
        "code": "condition",
        "robot": "ACME/r1",
        "order": "",
        "text": odd,
        "values": '{"condition": "IDLE"}',
    }


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", "\t", "\r"])
def test_no_cell_is_a_formula(sign: str) -> None:
    (row,) = read(csv_head() + as_csv([entry(f"{sign}1+1", robot=f"{sign}cmd")]))
    assert (row["text"], row["robot"]) == (f"'{sign}1+1", f"'{sign}cmd")


def test_each_json_line_is_an_entry() -> None:
    first, second = entry("one\ntwo"), entry(robot=None)
    assert [json.loads(line) for line in as_json_lines([first, second]).splitlines()] == [first, second]
