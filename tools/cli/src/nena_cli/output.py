"""Output of commands in the format that the caller chooses, and exit statuses."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Final, NoReturn, TypeVar

import typer
from pydantic import BaseModel
from rich.console import Console

from nena_cli.narrow import is_too_wide, narrow
from nena_cli.options import Format
from nena_cli.styled import Table

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
    if not sys.stderr.isatty():
        sys.stderr.write(f"{text}\n")
        return
    Console(stderr=True).print(text, markup=False, highlight=False, style=style)


def fail(why: object, status: int = WRONG) -> NoReturn:
    """Print the reason in one line and exit."""
    echo(f"nena: {why}", style="red")
    raise typer.Exit(status)


def print_json(body: BaseModel) -> None:
    """Print a body as a line of JSON and flush."""
    _write_line(body.model_dump_json(by_alias=True))


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
        _write_line("---\n" + yaml.safe_dump(content, sort_keys=False, allow_unicode=True).rstrip())
    elif output is Format.NAME:
        _write_line(_name_of(body))
    else:
        print_json(body)


def print_table(what: Table, *, wide: bool = False) -> None:
    """Print a table; into a pipe its rows with tabs between the values, unless it is ``wide``.

    In a terminal that is too narrow for it, long values go below their row. A table without rows is a line of
    text in a terminal, or nothing if it has a title: then it is part of something.
    """
    if not wide and not is_terminal():
        for row in what.rows:
            _write_line("\t".join(" ".join(cell.plain.split()) for cell in row))
        return
    console = Console()
    if what.headers and not what.rows and is_terminal():
        if not what.title:
            console.print("No entries.", style="dim")
    elif wide:
        Console(width=UNLIMITED).print(what, soft_wrap=True)
    elif is_too_wide(what, console.width):
        for line in narrow(console, what):
            console.print(line, soft_wrap=True)
    else:
        console.print(what)


def is_terminal() -> bool:
    """Return whether standard output is a terminal, or is treated as one as Rich does."""
    return sys.stdout.isatty() or bool(os.environ.get("FORCE_COLOR"))


def _name_of(body: BaseModel) -> str:
    for field in IDENTIFIERS:
        if name := getattr(body, field, None):
            return str(name)
    fail("This answer has no name; use another --output.")


def _write_line(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
