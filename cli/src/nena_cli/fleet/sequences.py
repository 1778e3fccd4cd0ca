"""``nena sequences``: create, list, show, complete."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import Annotated
from urllib.parse import quote

import typer
from pydantic import JsonValue

from nena_cli.fleet import sequence_tables
from nena_cli.fleet.connection import Connection, Page, Query
from nena_cli.fleet.shell import AsJson, Token, TokenFile, Urls, connected, put_all, put_json, show
from nena_shared.fleet_api.order_sequence import OrderSequenceStatus

app = typer.Typer(help="Order sequences of a running order service.", no_args_is_help=True)

SEQUENCES = "/v1/orderSequences"


class SequencePage(Page):
    """Some of the order sequences."""

    order_sequences: tuple[OrderSequenceStatus, ...]


Name = Annotated[str, typer.Argument(help="Name of the order sequence.")]


@app.command()
def create(
    name: Annotated[str | None, typer.Argument(help="Name; without one the order service makes one.")] = None,
    *,
    types: Annotated[
        list[str] | None, typer.Option("--type", help="Type of orders that it takes; several times.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only this vehicle does it.")] = None,
    failure_fatal: Annotated[
        bool, typer.Option("--failure-fatal", help="When an order fails, those behind it fail, too.")
    ] = False,
    key: Annotated[
        str | None, typer.Option("--key", help="Idempotency key: the same again makes no second sequence.")
    ] = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Create an order sequence; orders are added by `nena orders create --sequence`."""
    body: dict[str, JsonValue] = {"failureFatal": failure_fatal}
    given = {"name": name, "intendedVehicle": vehicle, "idempotencyKey": key}
    body.update({field: value for field, value in given.items() if value is not None})
    if types:
        body["orderTypes"] = [*types]
    with connected(url, token, token_file) as connection:
        _put([connection.post(OrderSequenceStatus, SEQUENCES, body)], as_json=as_json)


@app.command("list")
def list_(
    *,
    finished: Annotated[
        bool | None, typer.Option("--finished/--unfinished", help="Only those; without it all.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only those that are meant for this vehicle.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="How many at most, the newest.")] = 50,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """List order sequences, newest first; with --json a line for each."""
    query: dict[str, str | int] = {}
    if finished is not None:
        query["finished"] = str(finished).lower()
    if vehicle is not None:
        query["intendedVehicle"] = vehicle
    with connected(url, token, token_file) as connection:
        _put([*islice(_all(connection, query), limit)], as_json=as_json)


@app.command("show")
def show_(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Show an order sequence with its history."""
    with connected(url, token, token_file) as connection:
        sequence = connection.get(OrderSequenceStatus, _path(name))
    if as_json:
        put_json(sequence)
    else:
        show(sequence_tables.sequence_details(sequence))
        show(sequence_tables.sequence_history(sequence))


@app.command()
def complete(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Mark an order sequence complete: no more orders are added, and its vehicle is free after the last."""
    with connected(url, token, token_file) as connection:
        _put([connection.post(OrderSequenceStatus, f"{_path(name)}/completion", {})], as_json=as_json)


def _all(connection: Connection, query: Query) -> Iterator[OrderSequenceStatus]:
    for page in connection.pages(SequencePage, SEQUENCES, query):
        yield from page.order_sequences


def _put(sequences: list[OrderSequenceStatus], *, as_json: bool) -> None:
    put_all(sequences, sequence_tables.sequences_table, as_json=as_json)


def _path(name: str) -> str:
    return f"{SEQUENCES}/{quote(name, safe='')}"
