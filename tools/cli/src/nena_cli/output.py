"""Output of commands for people and scripts, and exit statuses."""

from __future__ import annotations

import sys
from typing import Final, NoReturn

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table

REFUSED: Final = 1
"""Exit status if the order service rejects a request, or an awaited order fails."""
WRONG: Final = 2
"""Exit status of a command that failed."""


def echo(text: str, style: str | None = None) -> None:
    """Print a message for people on standard error."""
    Console(stderr=True, soft_wrap=True).print(text, markup=False, highlight=False, style=style)


def fail(why: object, status: int = WRONG) -> NoReturn:
    """Print the reason in one line and exit."""
    echo(f"nena: {why}", style="red")
    raise typer.Exit(status)


def print_json(body: BaseModel) -> None:
    """Print a body as a line of JSON and flush."""
    sys.stdout.write(body.model_dump_json(by_alias=True) + "\n")
    sys.stdout.flush()


def print_table(what: Table) -> None:
    """Print a table; 200 columns wide if standard output is not a terminal."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    console.print(what)
