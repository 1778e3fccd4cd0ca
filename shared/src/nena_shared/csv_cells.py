"""Cells of CSV files."""

from __future__ import annotations

# OWASP, "CSV Injection"
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
"""Spreadsheets execute cells that start with these; texts of robots must not be executed."""


def harmless(cell: str | None) -> str:
    """Return a text that no spreadsheet executes; None becomes empty."""
    return f"'{cell}" if cell and cell.startswith(FORMULA_SIGNS) else cell or ""
