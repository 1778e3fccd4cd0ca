from __future__ import annotations

import io
from datetime import datetime

import pytest
import typer

from nena_cli.order_files import read_orders

FILE = """\
name;stops;priority;dependencies
Shift-1;Goods in:Load cargo > Storage:Unload cargo;10;
Shift-2;Packing stand;;Shift-1 Shift-0
;Packing stand;;
"""


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_columns_may_be_separated_by_commas_semicolons_or_tabs(delimiter: str) -> None:
    lines = ("\ufeff" + FILE.replace(";", delimiter)).splitlines(keepends=True)
    (first_line, first), (_, second), (_, third) = read_orders(lines)
    assert first_line == 2
    assert [(each.location_name, each.operation) for each in first.destinations] == [
        ("Goods in", "Load cargo"),
        ("Storage", "Unload cargo"),
    ]
    assert (first.name, first.idempotency_key, first.priority) == ("Shift-1", "Shift-1", 10)
    assert second.dependencies == ("Shift-1", "Shift-0")
    assert "operation" not in second.destinations[0].model_fields_set
    assert (third.name, third.idempotency_key) == (None, None)


def test_a_deadline_without_a_zone_is_in_local_time() -> None:
    ((_, order),) = read_orders(["stops,deadline\n", "A,2026-12-01T14:30\n"])
    assert order.deadline == datetime(2026, 12, 1, 14, 30).astimezone()


def test_a_file_in_another_encoding_is_named() -> None:
    with (
        io.TextIOWrapper(io.BytesIO(b"stops\nTor \xfc\n"), encoding="utf-8") as file,
        pytest.raises(typer.BadParameter, match="UTF-8"),
    ):
        list(read_orders(file))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "No column 'stops'"),
        ("name\nA\n", "No column 'stops'"),
        ("stops,colour\nA,red\n", "Unknown column 'colour'"),
        ("stops,priority\nA,high\n", "Line 2: priority 'high'"),
        ("stops,priority\nA,1,2\n", "Line 2: more values"),
        ("stops,name\nA,B\n:,C\n", "Line 3: Invalid stop"),
        ("stops,deadline\nA,soon\n", "Line 2: deadline 'soon'"),
        (f"stops\n{'A' * 200_000}\n", "field larger"),
        ("stops,name\n,A\n", "Line 2: destinations"),
    ],
)
def test_errors_name_the_line_and_what_to_do(text: str, problem: str) -> None:
    with pytest.raises(typer.BadParameter, match=problem):
        list(read_orders(text.splitlines(keepends=True)))
