"""Tables that are wider than the terminal: long values go below their row, so that names stay whole."""

from __future__ import annotations

from collections.abc import Sequence
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
    return bool(table.headers) and sum(_column_widths(table)) + FRAME * len(table.headers) + 1 > width


def narrow(console: Console, table: Table) -> list[Text]:
    """Return a table as lines without frame and empty columns.

    The widest columns, but never the first, are below each row.
    """
    widths, columns = _column_widths(table), _columns_with_values(table)
    beside = list(columns)
    while _total_width(widths, beside) > console.width and len(beside) > 1:
        beside.remove(max(beside[1:], key=widths.__getitem__))
    lines = [Text(table.title, style="italic")] if table.title else []
    lines.append(_header_line(table, widths, beside))
    for row in table.rows:
        lines.append(_line_of(row, widths, beside))
        for column in columns:
            if column not in beside and row[column]:
                name = Text(f"{table.headers[column]}: ", style="dim")
                for line in name.append_text(row[column]).wrap(console, console.width - GAP):
                    line.rstrip()
                    lines.append(Text(" " * GAP).append_text(line))
    return lines


def brief(console: Console, table: Table) -> list[Text]:
    """Return a table as a line per row, cut off where the terminal ends; the last rows, as they fit it."""
    widths, columns = _column_widths(table), _columns_with_values(table)
    lines = [_line_of(row, widths, columns) for row in table.rows][-max(1, console.height - 2) :]
    lines = [_header_line(table, widths, columns), *lines]
    for line in lines:
        line.truncate(console.width - len("^C"), overflow="ellipsis")  # the terminal writes it there
    return lines


def _columns_with_values(table: Table) -> list[int]:
    return [each for each in range(len(table.headers)) if not each or any(row[each] for row in table.rows)]


def _total_width(widths: list[int], beside: list[int]) -> int:
    return sum(widths[each] + GAP for each in beside) - GAP


def _column_widths(table: Table) -> list[int]:
    """Return the width of each column if no value is broken."""
    columns = zip(*table.rows, strict=True) if table.rows else ([] for _ in table.headers)
    return [
        max(map(cell_len, (header, *(line for cell in cells for line in cell.plain.splitlines()))))
        for header, cells in zip(table.headers, columns, strict=True)
    ]


def _header_line(table: Table, widths: list[int], columns: list[int]) -> Text:
    return _line_of([Text(header, style="bold") for header in table.headers], widths, columns)


def _line_of(cells: Sequence[Text], widths: list[int], columns: list[int]) -> Text:
    line = Text()
    for column in columns:
        line.append_text(cells[column])
        line.append(" " * (widths[column] - cells[column].cell_len + GAP))
    line.rstrip()
    return line
