"""``nena vehicles``: list, show, watch, set the integration level, hibernate, wake."""

from __future__ import annotations

from datetime import UTC, datetime
from functools import partial
from typing import Annotated

import typer
from pydantic import JsonValue

from nena_cli import tables
from nena_cli.options import group
from nena_cli.output import REFUSED, fail
from nena_cli.service import Service, of_service, vehicle_names
from nena_cli.watching import Board, watch
from nena_client.exchange import Query
from nena_shared.clock import iso
from nena_shared.fleet_api.operations.vehicles import (
    INSTANT_ACTION,
    INTEGRATION_LEVEL,
    LIST_VEHICLES,
    ORDER_TYPES,
    REROUTE,
    SHOW_VEHICLE,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel, ReroutingType, VehicleState, VehicleStatus
from nena_shared.vda5050.action import (
    SHUTDOWN,
    START_HIBERNATION,
    STOP_HIBERNATION,
    WAKE_UP_TIME,
    ActionStatus,
)

app = group()


Name = Annotated[str, typer.Argument(help="Name of the vehicle.", autocompletion=vehicle_names)]


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    state: Annotated[
        list[VehicleState] | None, typer.Option(help="Only vehicles in this state; repeatable.")
    ] = None,
) -> None:
    """List vehicles, including robots that are not in the plant model; with --json one line each."""
    with service.connected() as connection:
        vehicles = connection.call(LIST_VEHICLES, query={"state": state}).vehicles
        filtered = state and any(vehicle.wait for vehicle in vehicles)
        fleet = connection.call(LIST_VEHICLES).vehicles if filtered else ()
    service.print_all(partial(tables.vehicles_table, fleet=fleet), *vehicles)


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show a vehicle and why it is not moving."""
    with service.connected() as connection:
        vehicle = connection.call(SHOW_VEHICLE, name)
        fleet = connection.call(LIST_VEHICLES).vehicles if vehicle.wait else ()
    service.print_all(partial(tables.vehicles_table, fleet=fleet), vehicle)


@app.command("watch")
@of_service
def watch_(
    service: Service,
    name: Annotated[str | None, typer.Argument(help="Only this vehicle. Unset: all.")] = None,
) -> None:
    """Watch vehicles until Ctrl-C; with --json one line per change."""
    query: Query = {"kind": "vehicle", "vehicle": name}
    board = Board(VehicleStatus, lambda shown: tables.vehicles_table(sorted(shown, key=_by_name)))
    with service.connected() as connection:
        if name is not None:
            connection.call(SHOW_VEHICLE, name)
        for _ in watch(connection, board, query, service.output):
            pass


@app.command("order-types")
@of_service
def order_types(
    service: Service,
    name: Name,
    types: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TYPE", help="Accepted order types in order of preference (* = any). Omit to list them."
        ),
    ] = None,
    *,
    none: Annotated[bool, typer.Option("--none", help="Accept no orders.")] = False,
) -> None:
    """Set or show the order types that a vehicle accepts."""
    if none and types:
        raise typer.BadParameter("Specify either types or --none")
    if types or none:
        wanted: list[JsonValue] = [{"name": each, "priority": n} for n, each in enumerate(types or ())]
        vehicle = service.call(ORDER_TYPES, name, body={"acceptableOrderTypes": wanted})
    else:
        vehicle = service.call(SHOW_VEHICLE, name)
    service.print_one(vehicle, tables.order_types_table(vehicle))


@app.command()
@of_service
def level(
    service: Service,
    name: Name,
    integration_level: Annotated[IntegrationLevel, typer.Argument(help="New integration level.")],
) -> None:
    """Set whether a vehicle gets orders, also after too many have failed, and whether others avoid it."""
    vehicle = service.call(INTEGRATION_LEVEL, name, body={"integrationLevel": integration_level.value})
    service.print_one(vehicle, tables.vehicles_table((vehicle,), ()))


@app.command()
@of_service
def reroute(
    service: Service,
    name: Name,
    *,
    forced: Annotated[
        bool, typer.Option("--forced", help="Replan from its current position: stops the robot first.")
    ] = False,
) -> None:
    """Replan the current order's route from the end of its released base."""
    kind = ReroutingType.FORCED if forced else ReroutingType.REGULAR
    done = service.call(REROUTE, name, body={"type": kind.value})
    service.print_one(done, tables.rerouting_table(done))


@app.command()
@of_service
def hibernate(
    service: Service,
    name: Name,
    *,
    until: Annotated[
        datetime | None, typer.Option(help="Wake-up time in local time; without it, until it is woken.")
    ] = None,
) -> None:
    """Put an idle vehicle into its low-power mode until it is woken or its wake-up time (VDA 5050 3.0)."""
    act(service, name, START_HIBERNATION, {WAKE_UP_TIME: iso(until.astimezone(UTC))} if until else {})


@app.command()
@of_service
def wake(service: Service, name: Name) -> None:
    """Wake a hibernating vehicle (VDA 5050 3.0)."""
    act(service, name, STOP_HIBERNATION, {})


@app.command()
@of_service
def shutdown(service: Service, name: Name) -> None:
    """Shut an idle vehicle down; it has to be switched on by hand (VDA 5050 3.0)."""
    act(service, name, SHUTDOWN, {})


def act(service: Service, name: str, action_type: str, parameters: dict[str, JsonValue]) -> None:
    """Send an instant action and print its result; exit with status 1 unless it has succeeded or runs."""
    listed: list[JsonValue] = [{"key": key, "value": value} for key, value in parameters.items()]
    answer = service.call(INSTANT_ACTION, name, body={"actionType": action_type, "parameters": listed})
    service.print_one(answer, tables.instant_action_table(name, answer))
    if answer.status not in (ActionStatus.FINISHED, "PENDING"):
        fail(f"{action_type} of {name} is {answer.status}: {answer.result or answer.reason}", REFUSED)


def _by_name(vehicle: VehicleStatus) -> str:
    return vehicle.name
