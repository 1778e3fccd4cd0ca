"""``nena schedules``: recurring transport orders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Annotated, Final

import typer
from pydantic import JsonValue
from pydantic.alias_generators import to_camel
from pydantic_core import from_json

from nena_cli import arguments as option
from nena_cli import tables
from nena_cli.arguments import parse_stop, refuse_beside_file
from nena_cli.options import group
from nena_cli.orders import print_or_watch
from nena_cli.output import fail
from nena_cli.service import Service, of_service
from nena_shared.clock import in_utc, iso
from nena_shared.fleet_api.operations.orders import CREATE_ORDER
from nena_shared.fleet_api.operations.schedules import (
    DELETE_SCHEDULE,
    ENABLE_SCHEDULE,
    LIST_SCHEDULES,
    PUT_SCHEDULE,
    SHOW_SCHEDULE,
)
from nena_shared.fleet_api.schedules import CATCH_UP_LIMIT, OPEN_ORDERS, OPEN_ORDERS_LIMIT

app = group()

OF_ORDER: Final = ("--vehicle", "--priority", "--type", "--timeout")
"""Options of the transport order."""

Name = Annotated[str, typer.Argument(help="Name of the schedule.")]


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the schedules with their next and last runs."""
    service.print_all(tables.schedules_table, *service.call(LIST_SCHEDULES).schedules)


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show a schedule with its next and last runs."""
    found = service.call(SHOW_SCHEDULE, name)
    service.print_one(found, tables.schedule_details(found), tables.schedule_runs_table(found))


@app.command()
@of_service
def put(
    service: Service,
    name: Name,
    cron: Annotated[
        str,
        typer.Argument(
            help="Minute, hour, day of month, month and weekday: '30 6 * * MON-FRI'; '': an order template."
        ),
    ],
    stops: option.Stops = None,
    *,
    file: Annotated[
        typer.FileBinaryRead | None,
        typer.Option(
            "--file", metavar="FILE", help="JSON file with the transport order; - for standard input."
        ),
    ] = None,
    zone: Annotated[str, typer.Option("--time-zone", help="Time zone, such as Europe/Berlin.")] = "UTC",
    valid_from: Annotated[datetime | None, typer.Option("--from", help="First run, local time.")] = None,
    valid_until: Annotated[
        datetime | None, typer.Option("--until", help="No run from this time on, local time.")
    ] = None,
    catch_up: Annotated[
        int,
        typer.Option(min=0, max=CATCH_UP_LIMIT, help="Missed runs to catch up after an outage, the latest."),
    ] = 0,
    max_open_orders: Annotated[
        int,
        typer.Option(min=1, max=OPEN_ORDERS_LIMIT, help="Skip runs while this many orders are open."),
    ] = OPEN_ORDERS,
    disabled: Annotated[bool, typer.Option("--disabled", help="Store it, but create no orders.")] = False,
    vehicle: option.Vehicle = None,
    priority: option.Priority = 0,
    kind: option.Type = "-",
    timeout: option.Timeout = None,
) -> None:
    """Create a schedule, or replace its definition."""
    given = {"intended_vehicle": vehicle, "priority": priority, "type": kind, "timeout": timeout}
    body: dict[str, JsonValue] = {
        "transportOrder": _order_template(service, stops or (), file, given),
        "cron": cron or None,
        "timeZone": zone,
        "validFrom": _utc_moment(valid_from),
        "validUntil": _utc_moment(valid_until),
        "catchUp": catch_up,
        "maxOpenOrders": max_open_orders,
        "enabled": not disabled,
    }
    service.print_all(tables.schedules_table, service.call(PUT_SCHEDULE, name, body=body))


@app.command()
@of_service
def run(service: Service, name: Name, *, wait: option.Wait = False) -> None:
    """Create an order of a schedule or order template now."""
    with service.connected() as connection:
        order = connection.call(SHOW_SCHEDULE, name).transport_order
        body = order.model_dump(mode="json", by_alias=True, exclude_unset=True)
        body |= {"name": name, "incompleteName": True}
        print_or_watch(service, connection, connection.call(CREATE_ORDER, body=body), wait=wait)


@app.command()
@of_service
def enable(service: Service, name: Name) -> None:
    """Enable a schedule. What it has missed while disabled is not caught up."""
    service.print_all(tables.schedules_table, service.call(ENABLE_SCHEDULE, name, body={"enabled": True}))


@app.command()
@of_service
def disable(service: Service, name: Name) -> None:
    """Disable a schedule: it creates no orders until it is enabled."""
    service.print_all(tables.schedules_table, service.call(ENABLE_SCHEDULE, name, body={"enabled": False}))


@app.command()
@of_service
def delete(service: Service, name: Name) -> None:
    """Delete a schedule; the orders that it has created stay."""
    service.print_all(tables.schedules_table, service.call(DELETE_SCHEDULE, name))


def _order_template(
    service: Service,
    stops: Sequence[str],
    file: typer.FileBinaryRead | None,
    given: Mapping[str, JsonValue],
) -> JsonValue:
    """Return the transport order of the stops and options, or of the file."""
    if bool(stops) == bool(file):
        raise typer.BadParameter("Specify stops or --file")
    if file is None:
        places: list[JsonValue] = [
            parse_stop(stop).model_dump(by_alias=True, exclude_unset=True) for stop in stops
        ]
        fields = {to_camel(name): value for name, value in given.items() if value is not None}
        return {"destinations": places, **fields}
    refuse_beside_file([each for each in service.given if each in OF_ORDER])
    try:
        order: JsonValue = from_json(file.read(), allow_inf_nan=False)
    except ValueError as error:
        fail(f"{file.name}: {error}")
    return order


def _utc_moment(local: datetime | None) -> str | None:
    return None if local is None else iso(in_utc(local.astimezone()))
