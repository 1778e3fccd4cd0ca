from __future__ import annotations

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
def test_orders_are_read_whatever_separates_the_columns(delimiter: str) -> None:
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


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "No column 'stops'"),
        ("name\nA\n", "No column 'stops'"),
        ("stops,colour\nA,red\n", "Unknown column 'colour'"),
        ("stops,priority\nA,high\n", "Line 2: priority 'high'"),
        ("stops,priority\nA,1,2\n", "Line 2: more values"),
        ("stops,name\nA,B\n:,C\n", "Line 3: Invalid stop"),
        ("stops,deadline\nA,soon\n", "Line 2: deadline"),
        ("stops,name\n,A\n", "Line 2: destinations"),
    ],
)
def test_errors_name_the_line_and_what_to_do(text: str, problem: str) -> None:
    with pytest.raises(typer.BadParameter, match=problem):
        list(read_orders(text.splitlines(keepends=True)))
