"""``nena orders``: create, list, show, watch, withdraw, hold, resume."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import datetime
from getpass import getuser
from itertools import islice
from typing import Annotated
from urllib.parse import quote

import typer
from pydantic import JsonValue, ValidationError

from nena_cli.fleet import tables
from nena_cli.fleet.connection import Connection, Page
from nena_cli.fleet.measures import parse_measure
from nena_cli.fleet.shell import (
    REFUSED,
    AsJson,
    Token,
    TokenFile,
    Urls,
    connected,
    put_all,
    put_json,
    say,
    show,
)
from nena_cli.fleet.stops import parse_property, parse_stop
from nena_cli.fleet.watch import Board, watch
from nena_shared.fleet_api.delivery import DeliveryStatus
from nena_shared.fleet_api.transport_order import (
    DependencyFailure,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.vda5050.malformed import problems_of

app = typer.Typer(help="Transport orders of a running order service.", no_args_is_help=True)

ORDERS = "/v1/transportOrders"


class OrderPage(Page):
    """Some of the orders."""

    transport_orders: tuple[TransportOrderStatus, ...]


Name = Annotated[str, typer.Argument(help="Name of the order.")]


@app.command()
def create(
    stops: Annotated[
        list[str] | None,
        typer.Argument(help="NAME, NAME:OPERATION or @X,Y,THETA, in the order of driving."),
    ] = None,
    *,
    file: Annotated[
        typer.FileText | None, typer.Option("--file", help="The whole request as JSON; - is standard input.")
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name; without one the order service makes one.")] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only this vehicle does it.")] = None,
    priority: Annotated[int, typer.Option(help="Greater is more urgent.")] = 0,
    deadline: Annotated[datetime | None, typer.Option(help="When it is due, in local time.")] = None,
    kind: Annotated[str, typer.Option("--type", help="Type of the order.")] = "-",
    dispensable: Annotated[
        bool, typer.Option("--dispensable", help="It may be dropped when something better comes.")
    ] = False,
    dependencies: Annotated[
        list[str] | None, typer.Option("--after", help="Order that must be FINISHED first; several times.")
    ] = None,
    on_dependency_failure: Annotated[
        DependencyFailure, typer.Option(help="What becomes of it when one of these fails.")
    ] = DependencyFailure.FAIL,
    sequence: Annotated[
        str | None, typer.Option("--sequence", help="Order sequence to which it is added.")
    ] = None,
    properties: Annotated[
        list[str] | None, typer.Option("--property", help="KEY=VALUE; several times if wanted.")
    ] = None,
    on_failure: Annotated[
        list[str] | None,
        typer.Option(
            "--on-failure",
            help="MEASURE, MEASURE:TIMES or MEASURE:TIMES:SECONDS; several times, in their order.",
        ),
    ] = None,
    timeout: Annotated[
        float | None, typer.Option(help="Seconds after which it is cancelled if it is not done.")
    ] = None,
    processing_timeout: Annotated[
        float | None, typer.Option(help="The same, from when it is first given to a vehicle.")
    ] = None,
    key: Annotated[
        str | None, typer.Option("--key", help="Idempotency key: the same again makes no second order.")
    ] = None,
    wait: Annotated[bool, typer.Option("--wait", help="Watch it to its end; status 1 if it fails.")] = False,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Create a transport order."""
    if (file is None) == (not stops):
        message = "give stops, or --file"
        raise typer.BadParameter(message)
    request = _request(
        file,
        name=name,
        destinations=tuple(map(parse_stop, stops or ())),
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
    with connected(url, token, token_file) as connection:
        body = request.model_dump(mode="json", by_alias=True, exclude_none=True)
        order = connection.post(TransportOrderStatus, ORDERS, body)
        if wait:
            watch_one(connection, order.name, as_json=as_json)
        else:
            put_orders([order], as_json=as_json)


@app.command("list")
def list_(
    *,
    state: Annotated[
        list[TransportOrderState] | None, typer.Option(help="Only those in this state; several times.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only those that are meant for this vehicle.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="How many at most, the newest.")] = 50,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """List transport orders, newest first; with --json a line for each."""
    with connected(url, token, token_file) as connection:
        query: dict[str, str | int | Sequence[str]] = {"state": [each.value for each in state or ()]}
        if vehicle is not None:
            query["intendedVehicle"] = vehicle
        put_orders(list(islice(_orders(connection, query), limit)), as_json=as_json)


@app.command("show")
def show_(
    name: Name,
    *,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Show a transport order with its delivery and its history."""
    with connected(url, token, token_file) as connection:
        order = connection.get(TransportOrderStatus, _path(name))
        delivery = connection.get(DeliveryStatus, f"{_path(name)}/delivery")
    if as_json:
        put_json(order)
    else:
        show(tables.order_details(order, delivery))
        show(tables.history_table(order))


@app.command("watch")
def watch_(
    name: Annotated[str | None, typer.Argument(help="One order, to its end; without it all.")] = None,
    *,
    vehicle: Annotated[str | None, typer.Option(help="Only those that this vehicle works on.")] = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Watch transport orders until Ctrl-C, or one to its end; with --json a line for each change."""
    with connected(url, token, token_file) as connection:
        if name is not None:
            watch_one(connection, name, as_json=as_json)
            return
        query = {"kind": "transportOrder", **({"vehicle": vehicle} if vehicle else {})}
        for _ in watch(connection, _board(), query, as_json=as_json):
            pass


@app.command()
def withdraw(
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's history.")] = None,
    version: Annotated[int | None, typer.Option(help="Only if it still has this version.")] = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Withdraw a transport order: it fails at once, or when its vehicle has let it go."""
    body: dict[str, JsonValue] = {} if reason is None else {"reason": reason}
    with connected(url, token, token_file) as connection:
        order = connection.post(TransportOrderStatus, f"{_path(name)}/withdrawal", body, _if(version))
        put_orders([order], as_json=as_json)


By = Annotated[str | None, typer.Option(help="Who asks; without it the name of the user.")]
Version = Annotated[int | None, typer.Option(help="Only if it still has this version.")]


@app.command()
def hold(
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's reason and history.")] = None,
    by: By = None,
    immediate: Annotated[
        bool, typer.Option(help="Its robot is to stop; else it drives to the end of what it was given.")
    ] = True,
    version: Version = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Let a transport order wait until it is resumed; it keeps its vehicle, which stands."""
    body: dict[str, JsonValue] = {"by": by or getuser(), "immediate": immediate}
    body |= {} if reason is None else {"reason": reason}
    with connected(url, token, token_file) as connection:
        order = connection.post(TransportOrderStatus, f"{_path(name)}/hold", body, _if(version))
        put_orders([order], as_json=as_json)


@app.command()
def resume(
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's history.")] = None,
    by: By = None,
    version: Version = None,
    url: Urls = None,
    token: Token = None,
    token_file: TokenFile = None,
    as_json: AsJson = False,
) -> None:
    """Let a held transport order go on from where its vehicle stands."""
    body: dict[str, JsonValue] = {"by": by or getuser()}
    body |= {} if reason is None else {"reason": reason}
    with connected(url, token, token_file) as connection:
        order = connection.post(TransportOrderStatus, f"{_path(name)}/resume", body, _if(version))
        put_orders([order], as_json=as_json)


def _if(version: int | None) -> dict[str, str]:
    return {} if version is None else {"If-Match": f'"{version}"'}


def _request(file: typer.FileText | None, **fields: object) -> TransportOrderRequest:
    """Make a request, of a file where there is one."""
    try:
        if file:
            return TransportOrderRequest.model_validate_json(file.read(), by_alias=True, by_name=False)
        return TransportOrderRequest.model_validate(fields)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(problems_of(error))) from error


def watch_one(connection: Connection, name: str, *, as_json: bool) -> None:
    """Watch an order to its end; the exit status says whether it was done."""
    order = connection.get(TransportOrderStatus, _path(name))
    if order.state.final:
        put_orders([order], as_json=as_json)
    else:
        query = {"kind": "transportOrder", "transportOrder": name}
        changes = watch(connection, _board(), query, as_json=as_json)
        order = next(each for each in changes if each.state.final)
        changes.close()
    if order.state is not TransportOrderState.FINISHED:
        say(f"nena: {order.name} is {order.state}: {order.reason}", style="red")
        raise typer.Exit(REFUSED)


def _orders(
    connection: Connection, query: dict[str, str | int | Sequence[str]]
) -> Iterator[TransportOrderStatus]:
    for page in connection.pages(OrderPage, ORDERS, query):
        yield from page.transport_orders


def put_orders(orders: list[TransportOrderStatus], *, as_json: bool) -> None:
    """Tell of orders: a table for people, a line of JSON for each for scripts."""
    put_all(orders, tables.orders_table, as_json=as_json)


def _board() -> Board[TransportOrderStatus]:
    return Board(TransportOrderStatus, tables.orders_table)


def _path(name: str) -> str:
    return f"{ORDERS}/{quote(name, safe='')}"
