"""What the commands for orders and vehicles have in common: options, output, faults."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final, TypeVar

import typer
from pydantic import BaseModel
from rich.console import Console
from rich.table import Table

from nena_cli.fleet.connection import Connection, NotReachedError, RefusedError

M = TypeVar("M", bound=BaseModel)

REFUSED: Final = 1
"""Exit status where the order service refuses something, or an order that was waited for has failed."""
WRONG: Final = 2
"""Exit status of a command that could not do its work."""

DEFAULT_URL = "http://127.0.0.1:55200"

Urls = Annotated[
    list[str] | None,
    typer.Option(
        "--url",
        envvar="NENA_URL",
        help="Address of the order service; several times where one stands by.",
        show_default=DEFAULT_URL,
    ),
]
Token = Annotated[
    str | None,
    typer.Option("--token", envvar="NENA_TOKEN", help="Token to log in with; better by environment."),
]
TokenFile = Annotated[Path | None, typer.Option("--token-file", help="File that holds the token.")]
AsJson = Annotated[bool, typer.Option("--json", help="JSON for scripts, as the REST API has it.")]


@contextmanager
def connected(urls: list[str] | None, token: str | None, token_file: Path | None) -> Iterator[Connection]:
    """Give a connection; end with one clear line where something goes wrong."""
    try:
        if token_file is not None:
            token = token_file.read_text(encoding="utf-8").strip()
        connection = Connection(urls or [DEFAULT_URL], token)
        try:
            yield connection
        finally:
            connection.close()
    except RefusedError as error:
        say(f"nena: {error}", style="red")
        raise typer.Exit(REFUSED) from error
    except (NotReachedError, OSError) as error:
        say(f"nena: no order service is reached\n{error}", style="red")
        raise typer.Exit(WRONG) from error
    except KeyboardInterrupt as error:
        raise typer.Exit(0) from error


def say(text: str, style: str | None = None) -> None:
    """Tell people something, on standard error."""
    Console(stderr=True, soft_wrap=True).print(text, markup=False, highlight=False, style=style)


def put_json(body: BaseModel) -> None:
    """Write a body as a line of JSON, at once."""
    sys.stdout.write(body.model_dump_json(by_alias=True) + "\n")
    sys.stdout.flush()


def put_all(found: Sequence[M], table: Callable[[Sequence[M]], Table], *, as_json: bool) -> None:
    """Tell of several things: a table for people, a line of JSON for each for scripts."""
    if as_json:
        for each in found:
            put_json(each)
    else:
        show(table(found))


def show(what: Table) -> None:
    """Print a table; wide where nobody looks at it on a screen."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=200)
    console.print(what)
