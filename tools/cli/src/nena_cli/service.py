"""The order service of a command: its options, and the output of its answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import wraps
from http import HTTPStatus
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Any, Concatenate, Final, ParamSpec, Protocol, TypeVar, Unpack

import httpx
import typer
from pydantic import BaseModel

from nena_cli.options import DEFAULT_URL, OPTIONS, Format, option, output_of, own_options
from nena_cli.output import REFUSED, fail, print_object, print_objects, print_table
from nena_cli.styled import Table
from nena_client import Client, RefusedError, UnreachableError
from nena_client.exchange import A, Options
from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.operations.orders import LIST_ORDERS
from nena_shared.fleet_api.operations.vehicles import LIST_VEHICLES

M = TypeVar("M", bound=BaseModel)
P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class Service:
    """An order service, and the format in which its answers are printed."""

    urls: Sequence[str]
    token: str | None
    token_file: Path | None
    output: Format
    given: tuple[str, ...] = ()
    """The command's own options on the command line, such as ``--vehicle``, also those that set a default."""

    @contextmanager
    def connected(self) -> Iterator[Client]:
        """Connect; report an error in one line and exit."""
        with self.reporting("order service", "--url or NENA_URL"), self.opened() as connection:
            yield connection

    def call(self, operation: Operation[A], name: str = "", **options: Unpack[Options]) -> A:
        """Connect for one call; report an error in one line and exit."""
        with self.connected() as connection:
            return connection.call(operation, name, **options)

    @contextmanager
    def reporting(self, server: str, options: str) -> Iterator[None]:
        """Report an error of a request in one line and exit; ``options`` set the address of the server."""
        try:
            yield
        except RefusedError as error:
            fail(self._explain_refusal(error), REFUSED)
        except BrokenPipeError:
            raise  # Typer exits quietly: the reader of standard output, such as head, has gone
        except (UnreachableError, httpx.HTTPError, httpx.InvalidURL, OSError) as error:
            if self.token_file and isinstance(error, OSError) and error.filename == str(self.token_file):
                fail(f"Cannot read the token file {self.token_file}: {error.strerror}. Check --token-file.")
            fail(f"Cannot connect to the {server}. Set {options}.\n{error}")
        except KeyboardInterrupt as error:
            raise typer.Exit(0) from error

    @contextmanager
    def opened(self) -> Iterator[Client]:
        """Connect; raises RefusedError, UnreachableError and OSError."""
        connection = Client(self.urls, self.access_token(), retry_for=0, user_agent="nena")
        try:
            yield connection
        finally:
            connection.close()

    def _explain_refusal(self, error: RefusedError) -> str:
        """Return the order service's text, or a hint about the token options."""
        if error.problem.status == HTTPStatus.UNAUTHORIZED and self.access_token() is None:
            return "The order service requires a token. Set NENA_TOKEN or --token-file."
        return str(error)

    def print_one(self, found: BaseModel, *tables: Table) -> None:
        """Print one object; ``tables`` show it to people."""
        if self.output in (Format.TABLE, Format.WIDE):
            for table in tables:
                print_table(table, wide=self.output is Format.WIDE)
        else:
            print_object(self.output, found)

    def print_all(self, table: Callable[[Sequence[M]], Table], *found: M) -> None:
        """Print several objects; ``table`` makes the table of them."""
        print_objects(self.output, found, table)

    def access_token(self) -> str | None:
        """Return the access token; raises OSError if its file cannot be read."""
        return self.token_file.read_text(encoding="utf-8").strip() if self.token_file else self.token


NAMES_COMPLETED: Final = 200
"""Orders that completion offers, the newest first."""

_CONTEXT: Final = Parameter("context", Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)


def of_service(command: Callable[Concatenate[Service, P], None]) -> Callable[..., None]:
    """Turn a function of a Service into a command with the options that select the service."""

    @wraps(command)
    def run(context: typer.Context, **given: Any) -> None:  # noqa: ANN401 - the command's own options
        own = {name: value for name, value in given.items() if name not in {each.name for each in OPTIONS}}
        done: Callable[..., None] = command
        done(service_of(context), **own)

    own = [*signature(command, eval_str=True).parameters.values()][1:]
    # Typer builds the command line from this signature.
    run.__signature__ = Signature([_CONTEXT, *own, *OPTIONS])  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in (_CONTEXT, *own, *OPTIONS)}
    return run


def service_of(context: typer.Context) -> Service:
    """Return the service that the options select; those nearest to the command's name win."""
    return Service(
        option(context, "url") or [DEFAULT_URL],
        option(context, "token"),
        option(context, "token_file"),
        output_of(context),
        own_options(context),
    )


def vehicle_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the names of vehicles for the shell's completion; empty if no order service answers."""
    return names(context, incomplete, lambda connection: connection.call(LIST_VEHICLES).vehicles)


def order_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the names of the newest orders for the shell's completion, as :func:`vehicle_names`."""
    query = {"limit": NAMES_COMPLETED}
    return names(
        context,
        incomplete,
        lambda connection: connection.call(LIST_ORDERS, query=query).transport_orders,
    )


class Named(Protocol):
    """An object with a name."""

    @property
    def name(self) -> str:
        """Its name."""


def names(context: typer.Context, incomplete: str, list_: Callable[[Client], Sequence[Named]]) -> list[str]:
    """Return the names that begin like ``incomplete``; empty if no order service answers."""
    try:
        with service_of(context).opened() as connection:
            return [each.name for each in list_(connection) if each.name.startswith(incomplete)]
    except (RefusedError, UnreachableError, OSError):
        return []
