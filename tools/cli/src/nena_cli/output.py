"""What commands tell people and scripts, and with which status they end."""

from __future__ import annotations

import sys
from typing import Final, NoReturn

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table

REFUSED: Final = 1
"""Exit status where the order service refuses something, or an order that was waited for has failed."""
WRONG: Final = 2
"""Exit status of a command that could not do its work."""


def say(text: str, style: str | None = None) -> None:
    """Tell people something, on standard error."""
    Console(stderr=True, soft_wrap=True).print(text, markup=False, highlight=False, style=style)


def give_up(why: object, status: int = WRONG) -> NoReturn:
    """End the command, and tell people in one clear line why its work is not done."""
    say(f"nena: {why}", style="red")
    raise typer.Exit(status)


def put_json(body: BaseModel) -> None:
    """Write a body as a line of JSON, at once."""
    sys.stdout.write(body.model_dump_json(by_alias=True) + "\n")
    sys.stdout.flush()


def show(what: Table) -> None:
    """Print a table; wide where nobody looks at it on a screen."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    console.print(what)
