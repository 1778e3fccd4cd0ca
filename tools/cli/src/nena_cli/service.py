"""The order service of a command: its options, and the output of its answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from http import HTTPStatus
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, Concatenate, Final, ParamSpec, TypeVar

import typer
from pydantic import BaseModel
from rich.table import Table

from nena_cli.client import Connection, RefusedError, UnreachableError
from nena_cli.output import REFUSED, fail, print_json, print_table

M = TypeVar("M", bound=BaseModel)
P = ParamSpec("P")

DEFAULT_URL: Final = "http://127.0.0.1:55200"

Urls = Annotated[
    list[str] | None,
    typer.Option(
        "--url",
        envvar="NENA_URL",
        help="URL of the order service; repeatable for a standby.",
        show_default=DEFAULT_URL,
    ),
]
Token = Annotated[
    str | None,
    typer.Option("--token", envvar="NENA_TOKEN", help="Access token; prefer the environment variable."),
]
TokenFile = Annotated[Path | None, typer.Option("--token-file", help="File that contains the token.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON as in the REST API.")]


@dataclass(frozen=True, slots=True)
class Service:
    """An order service, and whether its answers are printed as tables or JSON."""

    urls: Sequence[str]
    token: str | None
    token_file: Path | None
    as_json: bool

    @contextmanager
    def connected(self) -> Iterator[Connection]:
        """Connect; report an error in one line and exit."""
        try:
            connection = Connection(self.urls, self._token())
            try:
                yield connection
            finally:
                connection.close()
        except RefusedError as error:
            fail(self._explain(error), REFUSED)
        except (UnreachableError, OSError) as error:
            fail(f"Cannot connect to the order service. Set --url or NENA_URL.\n{error}")
        except KeyboardInterrupt as error:
            raise typer.Exit(0) from error

    def _explain(self, error: RefusedError) -> str:
        """Return the order service's text, or a hint about the token options."""
        if error.problem.status == HTTPStatus.UNAUTHORIZED and self._token() is None:
            return "The order service requires a token. Set NENA_TOKEN or --token-file."
        return str(error)

    def print_one(self, found: BaseModel, *tables: Table) -> None:
        """Print one object: as tables, or as a line of JSON."""
        if self.as_json:
            print_json(found)
        else:
            for each in tables:
                print_table(each)

    def print_all(self, found: Sequence[M], table: Callable[[Sequence[M]], Table]) -> None:
        """Print several objects: as a table, or as a line of JSON each."""
        if self.as_json:
            for each in found:
                print_json(each)
        else:
            print_table(table(found))

    def _token(self) -> str | None:
        return self.token_file.read_text(encoding="utf-8").strip() if self.token_file else self.token


_OPTIONS: Final = tuple(
    Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
    for name, default, annotation in (
        ("url", None, Urls),
        ("token", None, Token),
        ("token_file", None, TokenFile),
        ("as_json", False, AsJson),
    )
)


def of_service(command: Callable[Concatenate[Service, P], None]) -> Callable[..., None]:
    """Turn a function of a Service into a command with the options that select the service."""

    @wraps(command)
    def run(**given: Any) -> None:  # noqa: ANN401 - the command's own, and those of the service
        url, token, token_file, as_json = (given.pop(each.name) for each in _OPTIONS)
        done: Callable[..., None] = command
        done(Service(url or [DEFAULT_URL], token, token_file, as_json), **given)

    own = [*signature(command, eval_str=True).parameters.values()][1:]
    # Typer builds the command line from this signature.
    run.__signature__ = Signature([*own, *_OPTIONS])  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in (*own, *_OPTIONS)}
    return run
