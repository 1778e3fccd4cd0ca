"""``nena zones``: zone sets of VDA 5050 3.0 at a running order service."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import typer
from pydantic_core import from_json

from nena_cli import tables
from nena_cli.output import give_up
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.plant import ZoneSetList, ZoneSetStatus

app = typer.Typer(help="Zone sets of a running order service.", no_args_is_help=True)

ZONE_SETS = "/v1/zoneSets"

Name = Annotated[str, typer.Argument(help="zoneSetId of the zone set.")]


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the zone sets, and how they stand at the robots."""
    with service.connected() as connection:
        found = connection.get(ZoneSetList, ZONE_SETS)
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
        _put(service, connection.post(ZoneSetStatus, ZONE_SETS, body))


@app.command()
@of_service
def enable(service: Service, name: Name) -> None:
    """Have robots use a zone set, and no other one of its map."""
    with service.connected() as connection:
        done = connection.post(ZoneSetStatus, f"{ZONE_SETS}/{quote(name, safe='')}/enable", {})
    _put(service, done)


@app.command()
@of_service
def delete(service: Service, name: Name) -> None:
    """Have robots delete a zone set."""
    with service.connected() as connection:
        done = connection.delete(ZoneSetStatus, f"{ZONE_SETS}/{quote(name, safe='')}")
    _put(service, done)


def _put(service: Service, *zone_sets: ZoneSetStatus) -> None:
    service.put_all(zone_sets, tables.zone_sets_table)
