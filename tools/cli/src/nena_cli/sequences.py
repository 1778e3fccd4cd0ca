"""``nena sequences``: create, list, show, complete."""

from __future__ import annotations

from datetime import datetime
from itertools import islice
from typing import Annotated

import typer
from pydantic import JsonValue

from nena_cli import arguments as option
from nena_cli import tables
from nena_cli.options import group
from nena_cli.service import Service, of_service
from nena_client.exchange import Query
from nena_shared.fleet_api.operations.sequences import (
    COMPLETE_SEQUENCE,
    CREATE_SEQUENCE,
    LIST_SEQUENCES,
    SHOW_SEQUENCE,
)

app = group()


Name = Annotated[str, typer.Argument(help="Name of the order sequence.")]


@app.command()
@of_service
def create(
    service: Service,
    name: Annotated[str | None, typer.Argument(help="Name (optional).")] = None,
    *,
    types: Annotated[
        list[str] | None, typer.Option("--type", help="Accepted order type; repeatable.")
    ] = None,
    vehicle: option.Vehicle = None,
    failure_fatal: Annotated[
        bool, typer.Option("--failure-fatal", help="If an order fails, all following orders fail.")
    ] = False,
    key: Annotated[
        str | None,
        typer.Option("--key", help="Idempotency key: repeated requests create no second sequence."),
    ] = None,
) -> None:
    """Create an order sequence; add orders with `nena orders create --sequence`."""
    body: dict[str, JsonValue] = {"failureFatal": failure_fatal}
    given = {"name": name, "intendedVehicle": vehicle, "idempotencyKey": key}
    body.update({field: value for field, value in given.items() if value is not None})
    if types:
        body["orderTypes"] = [*types]
    service.print_all(tables.sequences_table, service.call(CREATE_SEQUENCE, body=body))


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    finished: Annotated[
        bool | None, typer.Option("--finished/--unfinished", help="Only these. Unset: all.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only sequences intended for this vehicle.")] = None,
    since: Annotated[
        datetime | None, typer.Option(help="Only sequences created since this local time.")
    ] = None,
    until: Annotated[
        datetime | None, typer.Option(help="Only sequences created before this local time.")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, help="Maximum number; the newest first.")] = 50,
) -> None:
    """List order sequences, newest first; with --json one line each."""
    query: Query = {"finished": finished, "intendedVehicle": vehicle, "since": since, "until": until}
    with service.connected() as connection:
        pages = connection.pages(LIST_SEQUENCES, query)
        service.print_all(
            tables.sequences_table, *islice((each for page in pages for each in page.order_sequences), limit)
        )


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show an order sequence with its history."""
    sequence = service.call(SHOW_SEQUENCE, name)
    service.print_one(sequence, tables.sequence_details(sequence), tables.history_table(sequence))


@app.command()
@of_service
def complete(service: Service, name: Name) -> None:
    """Complete an order sequence: it accepts no more orders and releases its vehicle after the last one."""
    service.print_all(tables.sequences_table, service.call(COMPLETE_SEQUENCE, name, body={}))
