"""``nena orders``: create, import, list, show, watch, change, withdraw, hold, resume."""

from __future__ import annotations

from collections.abc import Collection
from datetime import datetime
from getpass import getuser
from itertools import islice
from typing import Annotated

import typer
from pydantic import JsonValue, ValidationError

from nena_cli import arguments as option
from nena_cli import tables
from nena_cli.arguments import parse_measure, parse_property, parse_stop, refuse_beside_file
from nena_cli.options import Format, group
from nena_cli.order_files import read_orders
from nena_cli.output import REFUSED, echo, fail
from nena_cli.service import Service, of_service, order_names
from nena_cli.watching import Board, watch
from nena_client import Client
from nena_client.exchange import Query
from nena_shared.findings import FINDINGS_SHOWN
from nena_shared.fleet_api.operations.operation import Operation
from nena_shared.fleet_api.operations.orders import (
    CHANGE_ORDER,
    CREATE_ORDER,
    CREATE_ORDERS,
    DELIVERY,
    HOLD,
    LIST_ORDERS,
    RESUME,
    SHOW_ORDER,
    WITHDRAW,
)
from nena_shared.fleet_api.operations.vehicles import SHOW_VEHICLE
from nena_shared.fleet_api.transport_order import (
    DependencyFailure,
    TransportOrderBatch,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.vda5050.malformed import problems_of

NONE = "none"
"""Value of an option that takes something away from an order."""
BATCH = 1000
"""Orders that one request creates."""


app = group()

Name = Annotated[str, typer.Argument(help="Name of the order.", autocompletion=order_names)]
Names = Annotated[list[str], typer.Argument(help="Names of the orders.", autocompletion=order_names)]
By = Annotated[str | None, typer.Option(help="Name of the requester. Unset: the user name.")]
Version = Annotated[int | None, typer.Option(help="Change only if the order still has this version.")]


@app.command()
@of_service
def create(
    service: Service,
    stops: option.Stops = None,
    *,
    file: option.File = None,
    name: option.NewName = None,
    vehicle: option.Vehicle = None,
    priority: option.Priority = 0,
    deadline: option.Deadline = None,
    kind: option.Type = "-",
    dispensable: option.Dispensable = False,
    dependencies: option.Dependencies = None,
    on_dependency_failure: option.OnDependencyFailure = DependencyFailure.FAIL,
    sequence: option.Sequence = None,
    properties: option.Properties = None,
    on_failure: option.OnFailure = None,
    timeout: option.Timeout = None,
    processing_timeout: option.ProcessingTimeout = None,
    key: option.Key = None,
    wait: option.Wait = False,
) -> None:
    """Create a transport order."""
    request = _build_request(
        service,
        file,
        destinations=tuple(map(parse_stop, stops or ())),
        name=name,
        intended_vehicle=vehicle,
        priority=priority,
        deadline=deadline.astimezone() if deadline else None,
        type=kind,
        dispensable=dispensable,
        dependencies=tuple(dependencies or ()),
        on_dependency_failure=on_dependency_failure,
        wrapping_sequence=sequence,
        properties=tuple(map(parse_property, properties or ())),
        on_failure=None if on_failure is None else tuple(map(parse_measure, on_failure)),
        timeout=timeout,
        processing_timeout=processing_timeout,
        idempotency_key=key,
    )
    body = request.model_dump(mode="json", by_alias=True, exclude_none=True, exclude_unset=True)
    with service.connected() as connection:
        print_or_watch(service, connection, connection.call(CREATE_ORDER, body=body), wait=wait)


@app.command("import")
@of_service
def import_(
    service: Service,
    file: Annotated[typer.FileText, typer.Argument(metavar="FILE", help="CSV file; - for standard input.")],
    *,
    check: Annotated[
        bool, typer.Option("--check", help="Create nothing; show what would be refused.")
    ] = False,
) -> None:
    """Create a transport order for each line of a CSV file.

    The column `stops` has the stops of `nena orders create`, separated by `>`. Further columns: name,
    priority, deadline, intendedVehicle, type, dependencies. An order with a name is not created twice.
    """
    orders, created, refused = list(read_orders(file)), 0, 0
    with service.connected() as connection:
        for start in range(0, len(orders), BATCH):
            part = orders[start : start + BATCH]
            if check:  # orders of earlier parts are not created
                names = {order.name for _, order in orders[:start]}
                part = [(line, _without_dependencies(order, names)) for line, order in part]
            request = TransportOrderBatch(
                transport_orders=tuple(order for _, order in part), check_only=check
            )
            results = connection.call(CREATE_ORDERS, request=request).results
            for (line, _), result in zip(part, results, strict=True):
                if result.problem:
                    refused += 1
                    detail = "; ".join((result.problem.detail, *result.problem.errors))
                    echo(f"line {line} ({result.name or 'no name'}): {detail}", "red")
            made = tuple(each.transport_order for each in results if each.transport_order)
            created += sum(not each.problem for each in results)
            if made and service.output is not Format.TABLE:
                service.print_all(tables.orders_table, *made)
    echo(f"{created} {'possible' if check else 'created, or already there'}, {refused} refused")
    if refused:
        raise typer.Exit(REFUSED)


def _without_dependencies(
    order: TransportOrderRequest, names: Collection[str | None]
) -> TransportOrderRequest:
    left = tuple(dependency for dependency in order.dependencies if dependency not in names)
    return order.model_copy(update={"dependencies": left})


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    state: Annotated[
        list[TransportOrderState] | None, typer.Option(help="Only orders in this state; repeatable.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only orders intended for this vehicle.")] = None,
    since: Annotated[datetime | None, typer.Option(help="Only orders created since this local time.")] = None,
    until: Annotated[
        datetime | None, typer.Option(help="Only orders created before this local time.")
    ] = None,
    limit: Annotated[int, typer.Option(min=1, help="Maximum number; the newest first.")] = 50,
) -> None:
    """List transport orders, newest first; with --json one line each."""
    with service.connected() as connection:
        query: Query = {"state": state, "intendedVehicle": vehicle, "since": since, "until": until}
        pages = connection.pages(LIST_ORDERS, query)
        found = tuple(islice((each for page in pages for each in page.transport_orders), limit))
        if vehicle is not None and not found:
            connection.call(SHOW_VEHICLE, vehicle)  # an unknown one is an error
        service.print_all(tables.orders_table, *found)


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show a transport order with its delivery and history."""
    with service.connected() as connection:
        order = connection.call(SHOW_ORDER, name)
        delivery = connection.call(DELIVERY, name)
    service.print_one(order, tables.order_details(order, delivery), tables.history_table(order))


@app.command("watch")
@of_service
def watch_(
    service: Service,
    name: Annotated[str | None, typer.Argument(help="One order, watched to its end. Unset: all.")] = None,
    *,
    vehicle: Annotated[str | None, typer.Option(help="Only orders of this vehicle.")] = None,
) -> None:
    """Watch transport orders until Ctrl-C, or one to its end; with --json one line per change."""
    with service.connected() as connection:
        if name is not None:
            _watch_one(service, connection, name)
            return
        if vehicle is not None:
            connection.call(SHOW_VEHICLE, vehicle)  # an unknown one is an error
        query: Query = {"kind": "transportOrder", "vehicle": vehicle}
        for _ in watch(connection, Board(TransportOrderStatus, tables.orders_table), query, service.output):
            pass


@app.command()
@of_service
def change(
    service: Service,
    name: Name,
    *,
    priority: Annotated[int | None, typer.Option(min=-1000, max=1000, help="Higher is more urgent.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Intended vehicle; none: any.")] = None,
    deadline: Annotated[str | None, typer.Option(help="Local time in ISO 8601; none: no deadline.")] = None,
    timeout: Annotated[str | None, typer.Option(help="Seconds from its creation; none: no timeout.")] = None,
    version: Version = None,
) -> None:
    """Change a transport order that waits for a vehicle; what is not given stays as it is."""
    given = {"intendedVehicle": vehicle, "deadline": _local_moment(deadline), "timeout": timeout}
    body: dict[str, JsonValue] = {
        field: None if value == NONE else value for field, value in given.items() if value is not None
    }
    if priority is not None:
        body["priority"] = priority
    _change_order(service, CHANGE_ORDER, name, body, version)


def _local_moment(text: str | None) -> str | None:
    """Return a local time with its zone; NONE and None stay as they are."""
    if text in (None, NONE):
        return text
    try:
        return datetime.fromisoformat(text).astimezone().isoformat()
    except ValueError as error:
        raise typer.BadParameter(f"Write the deadline {text!r} as 2026-01-31T10:00, or {NONE}") from error


@app.command()
@of_service
def withdraw(
    service: Service,
    names: Names,
    *,
    reason: Annotated[str, typer.Option(help="Reason, kept in the order's history.")] = "withdrawn by a host",
    version: Version = None,
) -> None:
    """Withdraw transport orders: each fails immediately, or when its vehicle has released it."""
    for name in names:
        _change_order(service, WITHDRAW, name, {"reason": reason}, version)


@app.command()
@of_service
def hold(
    service: Service,
    name: Name,
    *,
    reason: Annotated[
        str, typer.Option(help="Reason, shown with the order and kept in its history.")
    ] = "no reason given",
    by: By = None,
    immediate: Annotated[
        bool, typer.Option(help="Stop the robot now; otherwise it drives to the end of its base.")
    ] = True,
    version: Version = None,
) -> None:
    """Hold a transport order until it is resumed; it keeps its vehicle."""
    body: dict[str, JsonValue] = {"by": by or getuser(), "immediate": immediate, "reason": reason}
    _change_order(service, HOLD, name, body, version)


@app.command()
@of_service
def resume(
    service: Service,
    name: Name,
    *,
    reason: Annotated[str, typer.Option(help="Reason, kept in the order's history.")] = "no reason given",
    by: By = None,
    version: Version = None,
) -> None:
    """Resume a held transport order from its vehicle's position."""
    _change_order(service, RESUME, name, {"by": by or getuser(), "reason": reason}, version)


def _change_order(
    service: Service,
    operation: Operation[TransportOrderStatus],
    name: str,
    body: dict[str, JsonValue],
    version: int | None,
) -> None:
    """Change an order, if it still has that version, and print it."""
    headers = {} if version is None else {"If-Match": f'"{version}"'}
    service.print_all(tables.orders_table, service.call(operation, name, body=body, headers=headers))


def _build_request(
    service: Service, file: typer.FileBinaryRead | None, **fields: object
) -> TransportOrderRequest:
    """Build a request from a file or from the options."""
    if (file is None) == (not fields["destinations"]):
        raise typer.BadParameter("Specify stops or --file, not both" if file else "Specify stops or --file")
    if file:
        refuse_beside_file([each for each in service.given if each not in ("--file", "--wait")])
    try:
        if file:
            return TransportOrderRequest.model_validate_json(file.read(), by_alias=True, by_name=False)
        return TransportOrderRequest.model_validate(fields)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(problems_of(error, FINDINGS_SHOWN))) from error


def print_or_watch(service: Service, connection: Client, order: TransportOrderStatus, *, wait: bool) -> None:
    """Print a new order, or with ``wait`` watch it to its end and set the exit status."""
    if wait:
        _watch_one(service, connection, order.name)
    else:
        service.print_all(tables.orders_table, order)


def _watch_one(service: Service, connection: Client, name: str) -> None:
    """Watch an order to its end; exit with status 1 unless it is FINISHED."""
    order = connection.call(SHOW_ORDER, name)
    if order.state.final:
        service.print_all(tables.orders_table, order)
    else:
        query: Query = {"kind": "transportOrder", "transportOrder": name}
        changes = watch(connection, Board(TransportOrderStatus, tables.orders_table), query, service.output)
        order = next(change for change in changes if change.state.final)
        changes.close()
    if order.state is not TransportOrderState.FINISHED:
        fail(f"{order.name} is {order.state}: {order.reason}", REFUSED)
