"""Output of commands in the format that the caller chooses, and exit statuses."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Final, NoReturn, TypeVar

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table
from rich.text import Text

from nena_cli.narrow import is_too_wide, print_narrow
from nena_cli.options import Format

M = TypeVar("M", bound=BaseModel)

REFUSED: Final = 1
"""Exit status if the order service rejects a request, or an awaited order fails."""
WRONG: Final = 2
"""Exit status of a command that failed."""

UNLIMITED: Final = 10_000
"""Columns of a table that is not wrapped."""

IDENTIFIERS: Final = ("name", "zone_set_id", "vehicle", "location")
"""Fields that name an object, in order of preference."""


def echo(text: str, style: str | None = None) -> None:
    """Print a message for people on standard error."""
    Console(stderr=True, soft_wrap=True).print(text, markup=False, highlight=False, style=style)


def fail(why: object, status: int = WRONG) -> NoReturn:
    """Print the reason in one line and exit."""
    echo(f"nena: {why}", style="red")
    raise typer.Exit(status)


def print_json(body: BaseModel) -> None:
    """Print a body as a line of JSON and flush."""
    _write(body.model_dump_json(by_alias=True))


def print_objects(output: Format, found: Sequence[M], table: Callable[[Sequence[M]], Table]) -> None:
    """Print objects in this format; ``table`` makes the table of them."""
    if output in (Format.TABLE, Format.WIDE):
        print_table(table(found), wide=output is Format.WIDE)
    else:
        for each in found:
            print_object(output, each)


def print_object(output: Format, body: BaseModel) -> None:
    """Print an object as JSON, as YAML or by its name."""
    if output is Format.YAML:
        import yaml  # type: ignore[import-untyped] # noqa: PLC0415 - the command starts faster without it

        content = body.model_dump(mode="json", by_alias=True)
        _write("---\n" + yaml.safe_dump(content, sort_keys=False, allow_unicode=True).rstrip())
    elif output is Format.NAME:
        _write(_name_of(body))
    else:
        print_json(body)


def print_table(what: Table, *, wide: bool = False) -> None:
    """Print a table; into a pipe its rows with tabs between the values, unless it is ``wide``.

    In a terminal that is too narrow for it, long values go below their row.
    """
    console = Console()
    if wide:
        Console(width=UNLIMITED).print(what, soft_wrap=True)
    elif console.is_terminal and is_too_wide(what, console.width):
        print_narrow(console, what)
    elif console.is_terminal:
        console.print(what)
    else:
        for row in zip(*(column.cells for column in what.columns), strict=True):
            _write("\t".join(_plain(cell) for cell in row))


def _plain(cell: object) -> str:
    """Return the text of a table's cell in one line."""
    text = cell.plain if isinstance(cell, Text) else str(cell)
    return " ".join(text.split())


def _name_of(body: BaseModel) -> str:
    for field in IDENTIFIERS:
        if name := getattr(body, field, None):
            return str(name)
    fail("This answer has no name; use another --output.")


def _write(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
