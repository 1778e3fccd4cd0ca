"""``nena dispatch``: send a vehicle to a destination."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import JsonValue

from nena_cli import arguments as option
from nena_cli.arguments import COORDINATE, parse_coordinate
from nena_cli.orders import print_or_watch
from nena_cli.service import Service, of_service
from nena_cli.vehicles import Name
from nena_shared.fleet_api.operations.vehicles import DISPATCH


@of_service
def dispatch(
    service: Service,
    name: Name,
    place: Annotated[str, typer.Argument(help="Point, location with --operation, or @X,Y,THETA.")],
    *,
    operation: Annotated[str | None, typer.Option(help="Operation at the location.")] = None,
    priority: option.Priority = 0,
    wait: option.Wait = False,
) -> None:
    """Send a vehicle to a destination with a transport order of its own."""
    body: dict[str, JsonValue] = {"priority": priority}
    if place.startswith(COORDINATE):
        coordinate = parse_coordinate(place.removeprefix(COORDINATE))
        body["coordinate"] = coordinate.model_dump(exclude_none=True)
    elif operation is not None:
        body["locationName"] = place
    else:
        body["point"] = place
    if operation is not None:
        body["operation"] = operation
    with service.connected() as connection:
        order = connection.call(DISPATCH, name, body=body)
        print_or_watch(service, connection, order, wait=wait)
