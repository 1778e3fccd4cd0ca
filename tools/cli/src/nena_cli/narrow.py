"""Tables that are wider than the terminal: long values go below their row, so that names stay whole."""

from __future__ import annotations

from typing import Final

from rich.cells import cell_len
from rich.console import Console
from rich.text import Text

from nena_cli.styled import Table

GAP: Final = 2
"""Columns between two values, and before a value below its row."""
FRAME: Final = 3
"""Columns that a framed table needs for each of its columns."""


def is_too_wide(table: Table, width: int) -> bool:
    """Return whether a table with a header would have to break its values to fit."""
    return bool(table.headers) and sum(_widths(table)) + FRAME * len(table.headers) + 1 > width


def print_narrow(console: Console, table: Table) -> None:
    """Print a table without frame and empty columns; the widest ones, but never the first, below each row."""
    widths = _widths(table)
    empty = {each for each in range(1, len(widths)) if not any(row[each] for row in table.rows)}
    below: set[int] = set()
    while _total(widths, below | empty) > console.width and len(below | empty) < len(widths) - 1:
        below.add(max(set(range(1, len(widths))) - below - empty, key=widths.__getitem__))
    beside = [each for each in range(len(widths)) if each not in below | empty]
    if table.title:
        console.print(Text(table.title, style="italic"))
    _print_row(console, [Text(table.headers[each], style="bold") for each in beside], widths, beside)
    for row in table.rows:
        cells = [each.__rich__() for each in row]
        _print_row(console, [cells[each] for each in beside], widths, beside)
        for each in sorted(below):
            if cells[each].plain:
                name = Text(f"{table.headers[each]}: ", style="dim")
                for line in name.append_text(cells[each]).wrap(console, console.width - GAP):
                    line.rstrip()
                    console.print(Text(" " * GAP).append_text(line), soft_wrap=True)


def _total(widths: list[int], without: set[int]) -> int:
    beside = [width for each, width in enumerate(widths) if each not in without]
    return sum(beside) + GAP * (len(beside) - 1)


def _widths(table: Table) -> list[int]:
    """Return the width of each column if no value is broken."""
    columns = zip(*table.rows, strict=True) if table.rows else ([] for _ in table.headers)
    return [
        max(map(cell_len, (header, *(line for cell in cells for line in cell.plain.splitlines()))))
        for header, cells in zip(table.headers, columns, strict=True)
    ]


def _print_row(console: Console, cells: list[Text], widths: list[int], columns: list[int]) -> None:
    line = Text()
    for cell, column in zip(cells, columns, strict=True):
        line.append_text(cell)
        line.append(" " * (widths[column] - cell.cell_len + GAP))
    line.rstrip()
    console.print(line, soft_wrap=True)
