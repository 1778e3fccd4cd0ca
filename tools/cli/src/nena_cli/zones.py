"""``nena zones``: zone sets of VDA 5050 3.0 at a running order service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic_core import from_json

from nena_cli import tables
from nena_cli.options import group
from nena_cli.output import fail
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations.plant import (
    DELETE_ZONE_SET,
    ENABLE_ZONE_SET,
    LIST_ZONE_SETS,
    PUT_ZONE_SET,
)

app = group()

Name = Annotated[str, typer.Argument(help="zoneSetId of the zone set.")]


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the zone sets and their status at the robots."""
    service.print_all(tables.zone_sets_table, *service.call(LIST_ZONE_SETS).zone_sets)


@app.command()
@of_service
def put(
    service: Service,
    file: Annotated[Path, typer.Argument(help="JSON file with a zoneSet object of VDA 5050.")],
) -> None:
    """Upload a zone set; robots with VDA 5050 3.0 receive it disabled."""
    try:
        body = from_json(file.read_bytes(), allow_inf_nan=False)
    except (OSError, ValueError) as error:
        fail(f"{file}: {error}")
    service.print_all(tables.zone_sets_table, service.call(PUT_ZONE_SET, body=body))


@app.command()
@of_service
def enable(service: Service, name: Name) -> None:
    """Enable a zone set at the robots; disables the others of its map."""
    service.print_all(tables.zone_sets_table, service.call(ENABLE_ZONE_SET, name, body={}))


@app.command()
@of_service
def delete(service: Service, name: Name) -> None:
    """Delete a zone set at the robots."""
    service.print_all(tables.zone_sets_table, service.call(DELETE_ZONE_SET, name))
