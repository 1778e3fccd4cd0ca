"""Tables whose rows can be drawn by Rich, and written one by one."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table as RichTable
from rich.text import Text


class Table:
    """Rows of texts below their headers; without headers, names and values."""

    def __init__(self, *headers: str, title: str = "", frame: bool = True) -> None:
        self.headers = headers
        self.title = title
        self.frame = frame
        self.rows: list[Sequence[Text]] = []

    def add_row(self, *cells: Text | str) -> None:
        """Add a row; texts that are missing at its end are empty."""
        row = [cell if isinstance(cell, Text) else Text(cell) for cell in cells]
        self.rows.append([*row, *(Text() for _ in self.headers[len(row) :])])

    def __rich__(self) -> RichTable:
        """Return the table for Rich."""
        if self.frame:
            table = RichTable(*self.headers, title=self.title or None, title_justify="left")
        else:
            table = RichTable(*self.headers, show_header=bool(self.headers), box=None, padding=(0, 2, 0, 0))
        for row in self.rows:
            table.add_row(*row)
        return table
