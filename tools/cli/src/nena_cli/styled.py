"""Texts and tables with styles. Rich draws them on terminals only: pipes need not wait for its import."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from rich.table import Table as RichTable
    from rich.text import Text as RichText


class Text:
    """A text of parts, each with a style of Rich. Markup in it is not interpreted."""

    def __init__(self, text: str = "", style: str = "") -> None:
        self._parts = [(text, style)] if text else []

    def append(self, text: str, style: str = "") -> Self:
        """Add a part and return the text."""
        self._parts.append((text, style))
        return self

    @property
    def plain(self) -> str:
        """The text without styles."""
        return "".join(text for text, _ in self._parts)

    def __bool__(self) -> bool:
        """Return whether it has any characters."""
        return bool(self.plain)

    def __rich__(self) -> RichText:
        """Return the text for Rich."""
        from rich.text import Text as RichText  # noqa: PLC0415 - see above

        return RichText.assemble(*self._parts)


class Table:
    """Rows of texts below their headers; without headers, names and values."""

    def __init__(self, *headers: str, title: str = "", frame: bool = True) -> None:
        self.headers = headers
        self.title = title
        self.frame = frame
        self.rows: list[Sequence[Text]] = []

    def add_row(self, *cells: Text | str) -> None:
        """Add a row; texts that are missing at its end are empty."""
        row = [each if isinstance(each, Text) else Text(each) for each in cells]
        self.rows.append([*row, *(Text() for _ in self.headers[len(row) :])])

    def __rich__(self) -> RichTable:
        """Return the table for Rich."""
        from rich.table import Table as RichTable  # noqa: PLC0415 - see above

        if self.frame:
            table = RichTable(*self.headers, title=self.title or None, title_justify="left")
        else:
            table = RichTable(*self.headers, show_header=bool(self.headers), box=None, padding=(0, 2, 0, 0))
        for row in self.rows:
            table.add_row(*row)
        return table
