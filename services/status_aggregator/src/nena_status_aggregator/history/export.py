"""History as files: CSV for spreadsheets, JSON lines for programs."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable
from io import StringIO

from nena_status_aggregator.history.entry import HistoryEntry

COLUMNS = ("id", "time", "code", "robot", "order", "text", "values")

FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
"""A cell that begins so is run by spreadsheets; what robots say must not be."""

Form = Callable[[Iterable[HistoryEntry]], str]


def csv_head() -> str:
    """Write the names of the columns."""
    return ",".join(COLUMNS) + "\r\n"


def as_csv(entries: Iterable[HistoryEntry]) -> str:
    """Write entries as rows (RFC 4180); the values are JSON in one cell."""
    text = StringIO(newline="")
    writer = csv.writer(text)
    for entry in entries:
        cells = (entry["robot"], entry["order"], entry["text"], json.dumps(entry["values"]))
        writer.writerow((entry["id"], entry["time"], entry["code"], *map(_harmless, cells)))
    return text.getvalue()


def as_json_lines(entries: Iterable[HistoryEntry]) -> str:
    """Write each entry as JSON in a line of its own."""
    return "".join(f"{json.dumps(entry)}\n" for entry in entries)


def _harmless(cell: str | None) -> str:
    return f"'{cell}" if cell and cell.startswith(FORMULA_SIGNS) else cell or ""
