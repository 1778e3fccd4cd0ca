"""The running order service that a command works with: the options that name it, and how it is told of."""

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

from nena_cli.client import Connection, NotReachedError, RefusedError
from nena_cli.output import REFUSED, give_up, put_json, show

M = TypeVar("M", bound=BaseModel)
P = ParamSpec("P")

DEFAULT_URL: Final = "http://127.0.0.1:55200"

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


@dataclass(frozen=True, slots=True)
class Service:
    """An order service, and whether people or scripts are told of what it answers."""

    urls: Sequence[str]
    token: str | None
    token_file: Path | None
    as_json: bool

    @contextmanager
    def connected(self) -> Iterator[Connection]:
        """Give a connection; end with one clear line where something goes wrong."""
        try:
            connection = Connection(self.urls, self._token())
            try:
                yield connection
            finally:
                connection.close()
        except RefusedError as error:
            give_up(self._words(error), REFUSED)
        except (NotReachedError, OSError) as error:
            give_up(f"no order service is reached\n{error}")
        except KeyboardInterrupt as error:
            raise typer.Exit(0) from error

    def _words(self, error: RefusedError) -> str:
        """Say it as the order service does, but for what it says to programs about tokens."""
        if error.problem.status == HTTPStatus.UNAUTHORIZED and self._token() is None:
            return "the order service asks for a token: give one by NENA_TOKEN or --token-file"
        return str(error)

    def put(self, found: BaseModel, *tables: Table) -> None:
        """Tell of one thing: by tables for people, by a line of JSON for scripts."""
        if self.as_json:
            put_json(found)
        else:
            for each in tables:
                show(each)

    def put_all(self, found: Sequence[M], table: Callable[[Sequence[M]], Table]) -> None:
        """Tell of several things: by a table for people, by a line of JSON for each for scripts."""
        if self.as_json:
            for each in found:
                put_json(each)
        else:
            show(table(found))

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
    """Make a command of what is done with a service: behind its own options it has those that name one."""

    @wraps(command)
    def run(**given: Any) -> None:  # noqa: ANN401 - the command's own, and those of the service
        url, token, token_file, as_json = (given.pop(each.name) for each in _OPTIONS)
        done: Callable[..., None] = command
        done(Service(url or [DEFAULT_URL], token, token_file, as_json), **given)

    own = [*signature(command, eval_str=True).parameters.values()][1:]
    # What the command line is made of: typer reads it here.
    run.__signature__ = Signature([*own, *_OPTIONS])  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in (*own, *_OPTIONS)}
    return run
