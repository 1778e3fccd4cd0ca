"""``nena vehicles``: list, show, watch; and ``nena dispatch``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated
from urllib.parse import quote

import typer
from pydantic import JsonValue

from nena_cli.fleet import tables
from nena_cli.fleet.orders import put_orders, watch_one
from nena_cli.fleet.shell import AsJson, Token, TokenFile, Urls, connected, put_all, put_json, show
from nena_cli.fleet.stops import COORDINATE, parse_coordinate
from nena_cli.fleet.watch import Board, watch
from nena_shared.fleet_api.base import Resource
from nena_shared.fleet_api.rerouting import ReroutingAnswer, ReroutingType
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus

app = typer.Typer(help="Vehicles of a running order service.", no_args_is_help=True)

VEHICLES = "/v1/vehicles"


class VehiclePage(Resource):
    """The vehicles."""

    vehicles: tuple[VehicleStatus, ...]


Name = Annotated[str, typer.Argument(help="Name of the vehicle.")]


@app.command("list")
def list_(
    *,
    state: Annotated[
        list[VehicleState] | None, typer.Option(help="Only those in this state; several times.")
    ] = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """List the vehicles, and robots that are not in the plant model; with --json a line for each."""
    with connected(url, token, token_file) as connection:
        query = {"state": [each.value for each in state or ()]}
        vehicles = connection.get(VehiclePage, VEHICLES, query).vehicles
    _put(vehicles, as_json=as_json)


@app.command("show")
def show_(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Show a vehicle, and why it stands."""
    with connected(url, token, token_file) as connection:
        vehicle = connection.get(VehicleStatus, _path(name))
    _put([vehicle], as_json=as_json)


@app.command("watch")
def watch_(
    name: Annotated[str | None, typer.Argument(help="Only this vehicle; without it all.")] = None,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Watch vehicles until Ctrl-C; with --json a line for each change."""
    query = {"kind": "vehicle", **({"vehicle": name} if name else {})}
    board = Board(VehicleStatus, lambda shown: tables.vehicles_table(sorted(shown, key=_by_name)))
    with connected(url, token, token_file) as connection:
        if name is not None:
            connection.get(VehicleStatus, _path(name))
        for _ in watch(connection, board, query, as_json=as_json):
            pass


@app.command("order-types")
def order_types(
    name: Name,
    types: Annotated[
        list[str] | None,
        typer.Argument(help="Types that it accepts, liked best first; * is any. None: show them."),
    ] = None,
    *,
    none: Annotated[bool, typer.Option("--none", help="It accepts no orders.")] = False,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Say which types of orders a vehicle accepts, or show it."""
    if none and types:
        message = "give types, or --none"
        raise typer.BadParameter(message)
    with connected(url, token, token_file) as connection:
        if types or none:
            wanted: list[JsonValue] = [{"name": each, "priority": n} for n, each in enumerate(types or ())]
            body: dict[str, JsonValue] = {"acceptableOrderTypes": wanted}
            vehicle = connection.put(VehicleStatus, f"{_path(name)}/acceptableOrderTypes", body)
        else:
            vehicle = connection.get(VehicleStatus, _path(name))
    if as_json:
        put_json(vehicle)
    else:
        show(tables.order_types_table(vehicle))


@app.command()
def reroute(
    name: Name,
    *,
    forced: Annotated[
        bool, typer.Option("--forced", help="From where it stands: its robot is told to stop first.")
    ] = False,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Plan the way of the order that a vehicle works on anew, from the end of what its robot was given."""
    kind = ReroutingType.FORCED if forced else ReroutingType.REGULAR
    with connected(url, token, token_file) as connection:
        done = connection.post(ReroutingAnswer, f"{_path(name)}/rerouting", {"type": kind.value})
    if as_json:
        put_json(done)
    else:
        show(tables.rerouting_table(done))


def dispatch(
    name: Name,
    place: Annotated[str, typer.Argument(help="Point, location with --operation, or @X,Y,THETA.")],
    *,
    operation: Annotated[
        str | None, typer.Option(help="What to do at the place, which is a location then.")
    ] = None,
    priority: Annotated[int, typer.Option(help="Greater is more urgent.")] = 0,
    wait: Annotated[bool, typer.Option("--wait", help="Watch it to its end; status 1 if it fails.")] = False,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
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
    with connected(url, token, token_file) as connection:
        order = connection.post(TransportOrderStatus, f"{_path(name)}/dispatch", body)
        if wait:
            watch_one(connection, order.name, as_json=as_json)
        else:
            put_orders([order], as_json=as_json)


def _put(vehicles: Sequence[VehicleStatus], *, as_json: bool) -> None:
    put_all(vehicles, tables.vehicles_table, as_json=as_json)


def _by_name(vehicle: VehicleStatus) -> str:
    return vehicle.name


def _path(name: str) -> str:
    return f"{VEHICLES}/{quote(name, safe='')}"
