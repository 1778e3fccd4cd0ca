"""``nena zones``: zone sets of VDA 5050 3.0 at a running order service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic_core import from_json

from nena_cli import tables
from nena_cli.output import give_up
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations import DELETE_ZONE_SET, ENABLE_ZONE_SET, LIST_ZONE_SETS, PUT_ZONE_SET
from nena_shared.fleet_api.plant import ZoneSetStatus

app = typer.Typer(help="Zone sets of a running order service.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="zoneSetId of the zone set.")]


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the zone sets, and how they stand at the robots."""
    with service.connected() as connection:
        found = connection.call(LIST_ZONE_SETS)
    _put(service, *found.zone_sets)


@app.command()
@of_service
def put(
    service: Service,
    file: Annotated[Path, typer.Argument(help="The standard's zoneSet object, as JSON.")],
) -> None:
    """Put a zone set at the order service; robots of 3.0 get it, disabled."""
    try:
        body = from_json(file.read_bytes(), allow_inf_nan=False)
    except (OSError, ValueError) as error:
        give_up(f"{file}: {error}")
    with service.connected() as connection:
        _put(service, connection.call(PUT_ZONE_SET, body=body))


@app.command()
@of_service
def enable(service: Service, name: Name) -> None:
    """Have robots use a zone set, and no other one of its map."""
    with service.connected() as connection:
        done = connection.call(ENABLE_ZONE_SET, name, body={})
    _put(service, done)


@app.command()
@of_service
def delete(service: Service, name: Name) -> None:
    """Have robots delete a zone set."""
    with service.connected() as connection:
        done = connection.call(DELETE_ZONE_SET, name)
    _put(service, done)


def _put(service: Service, *zone_sets: ZoneSetStatus) -> None:
    service.put_all(zone_sets, tables.zone_sets_table)
