"""``nena vehicles``: list, show, watch; and ``nena dispatch``."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import JsonValue

from nena_cli import arguments as option
from nena_cli import tables
from nena_cli.arguments import COORDINATE, parse_coordinate
from nena_cli.orders import Board, put_or_watch, watch
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations import DISPATCH, LIST_VEHICLES, ORDER_TYPES, REROUTE, SHOW_VEHICLE
from nena_shared.fleet_api.vehicle import ReroutingType, VehicleState, VehicleStatus

app = typer.Typer(help="Vehicles of a running order service.", no_args_is_help=True)


Name = Annotated[str, typer.Argument(help="Name of the vehicle.")]


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    state: Annotated[
        list[VehicleState] | None, typer.Option(help="Only those in this state; several times.")
    ] = None,
) -> None:
    """List the vehicles, and robots that are not in the plant model; with --json a line for each."""
    with service.connected() as connection:
        query = {"state": [each.value for each in state or ()]}
        vehicles = connection.call(LIST_VEHICLES, query=query).vehicles
    _put(service, *vehicles)


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show a vehicle, and why it stands."""
    with service.connected() as connection:
        vehicle = connection.call(SHOW_VEHICLE, name)
    _put(service, vehicle)


@app.command("watch")
@of_service
def watch_(
    service: Service,
    name: Annotated[str | None, typer.Argument(help="Only this vehicle; without it all.")] = None,
) -> None:
    """Watch vehicles until Ctrl-C; with --json a line for each change."""
    query = {"kind": "vehicle", **({"vehicle": name} if name else {})}
    board = Board(VehicleStatus, lambda shown: tables.vehicles_table(sorted(shown, key=_by_name)))
    with service.connected() as connection:
        if name is not None:
            connection.call(SHOW_VEHICLE, name)
        for _ in watch(connection, board, query, as_json=service.as_json):
            pass


@app.command("order-types")
@of_service
def order_types(
    service: Service,
    name: Name,
    types: Annotated[
        list[str] | None,
        typer.Argument(help="Types that it accepts, liked best first; * is any. None: show them."),
    ] = None,
    *,
    none: Annotated[bool, typer.Option("--none", help="It accepts no orders.")] = False,
) -> None:
    """Say which types of orders a vehicle accepts, or show it."""
    if none and types:
        message = "give types, or --none"
        raise typer.BadParameter(message)
    with service.connected() as connection:
        if types or none:
            wanted: list[JsonValue] = [{"name": each, "priority": n} for n, each in enumerate(types or ())]
            body: dict[str, JsonValue] = {"acceptableOrderTypes": wanted}
            vehicle = connection.call(ORDER_TYPES, name, body=body)
        else:
            vehicle = connection.call(SHOW_VEHICLE, name)
    service.put(vehicle, tables.order_types_table(vehicle))


@app.command()
@of_service
def reroute(
    service: Service,
    name: Name,
    *,
    forced: Annotated[
        bool, typer.Option("--forced", help="From where it stands: its robot is told to stop first.")
    ] = False,
) -> None:
    """Plan the way of the order that a vehicle works on anew, from the end of what its robot was given."""
    kind = ReroutingType.FORCED if forced else ReroutingType.REGULAR
    with service.connected() as connection:
        done = connection.call(REROUTE, name, body={"type": kind.value})
    service.put(done, tables.rerouting_table(done))


@of_service
def dispatch(
    service: Service,
    name: Name,
    place: Annotated[str, typer.Argument(help="Point, location with --operation, or @X,Y,THETA.")],
    *,
    operation: Annotated[
        str | None, typer.Option(help="What to do at the place, which is a location then.")
    ] = None,
    priority: option.Priority = 0,
    wait: option.Wait = False,
) -> None:
    """Send a vehicle to a place, by a transport order that only it does."""
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
        put_or_watch(service, connection, order, wait=wait)


def _put(service: Service, *vehicles: VehicleStatus) -> None:
    service.put_all(vehicles, tables.vehicles_table)


def _by_name(vehicle: VehicleStatus) -> str:
    return vehicle.name
