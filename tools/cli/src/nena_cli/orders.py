"""``nena orders``: create, list, show, watch, withdraw, hold, resume."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from getpass import getuser
from itertools import islice
from typing import Annotated, Generic, TypeVar

import typer
from pydantic import BaseModel, JsonValue, ValidationError
from rich.console import Console
from rich.live import Live
from rich.table import Table

from nena_cli import arguments as option
from nena_cli import tables
from nena_cli.arguments import parse_measure, parse_property, parse_stop
from nena_cli.client import Connection, Event, follow
from nena_cli.output import REFUSED, give_up, put_json, say
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations import (
    CREATE_ORDER,
    DELIVERY,
    HOLD,
    LIST_ORDERS,
    RESUME,
    SHOW_ORDER,
    WITHDRAW,
    Operation,
)
from nena_shared.fleet_api.transport_order import (
    DependencyFailure,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.misfits import TOLD
from nena_shared.vda5050.malformed import problems_of

B = TypeVar("B", TransportOrderStatus, VehicleStatus)

ENDED_SHOWN = 10
"""Orders at their end that stay on the screen; older ones make room."""


class Board(Generic[B]):
    """What is on the screen: the newest state of each order or vehicle."""

    def __init__(self, model: type[B], table: Callable[[Collection[B]], Table]) -> None:
        self._model: type[B] = model
        self._table: Callable[[Collection[B]], Table] = table
        self._shown: dict[str, B] = {}

    def take(self, event: Event) -> B:
        """Take in an event; gives what it tells of."""
        body: B = self._model.model_validate(event.data)
        self._shown.pop(body.name, None)
        self._shown[body.name] = body
        ended = [each.name for each in self._shown.values() if _is_over(each)]
        for name in ended[:-ENDED_SHOWN]:
            del self._shown[name]
        return body

    def __rich__(self) -> Table:
        """Give the table."""
        return self._table(tuple(self._shown.values()))


def watch(connection: Connection, board: Board[B], query: dict[str, str], *, as_json: bool) -> Generator[B]:
    """Show what changes, and yield it; ends when the caller does."""
    events = follow(connection, query, on_break=lambda why: say(f"nena: connecting again: {why}", "yellow"))
    wanted = query["kind"]
    if as_json:
        for event in events:
            if event.kind == wanted:
                body = board.take(event)
                put_json(body)
                yield body
        return
    console = Console()
    try:
        with Live(board, console=console, refresh_per_second=8) as live:
            for event in events:
                if event.kind == wanted:
                    body = board.take(event)
                    live.refresh()
                    yield body
    finally:
        if not console.is_terminal:
            console.line()  # Live ends its last line on terminals only


def _is_over(body: BaseModel) -> bool:
    return isinstance(body, TransportOrderStatus) and body.state.final


app = typer.Typer(help="Transport orders of a running order service.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="Name of the order.")]
By = Annotated[str | None, typer.Option(help="Who asks; without it the name of the user.")]
Version = Annotated[int | None, typer.Option(help="Only if it still has this version.")]


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
    request = _request(
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
    body = request.model_dump(mode="json", by_alias=True, exclude_none=True)
    with service.connected() as connection:
        put_or_watch(service, connection, connection.call(CREATE_ORDER, body=body), wait=wait)


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    state: Annotated[
        list[TransportOrderState] | None, typer.Option(help="Only those in this state; several times.")
    ] = None,
    vehicle: Annotated[str | None, typer.Option(help="Only those that are meant for this vehicle.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="How many at most, the newest.")] = 50,
) -> None:
    """List transport orders, newest first; with --json a line for each."""
    with service.connected() as connection:
        query: dict[str, str | int | Sequence[str]] = {"state": [each.value for each in state or ()]}
        if vehicle is not None:
            query["intendedVehicle"] = vehicle
        _put(service, *islice(_orders(connection, query), limit))


@app.command("show")
@of_service
def show_(service: Service, name: Name) -> None:
    """Show a transport order with its delivery and its history."""
    with service.connected() as connection:
        order = connection.call(SHOW_ORDER, name)
        delivery = connection.call(DELIVERY, name)
    service.put(order, tables.order_details(order, delivery), tables.history_table(order))


@app.command("watch")
@of_service
def watch_(
    service: Service,
    name: Annotated[str | None, typer.Argument(help="One order, to its end; without it all.")] = None,
    *,
    vehicle: Annotated[str | None, typer.Option(help="Only those that this vehicle works on.")] = None,
) -> None:
    """Watch transport orders until Ctrl-C, or one to its end; with --json a line for each change."""
    with service.connected() as connection:
        if name is not None:
            _watch_one(service, connection, name)
            return
        query = {"kind": "transportOrder", **({"vehicle": vehicle} if vehicle else {})}
        for _ in watch(connection, _board(), query, as_json=service.as_json):
            pass


@app.command()
@of_service
def withdraw(
    service: Service,
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's history.")] = None,
    version: Version = None,
) -> None:
    """Withdraw a transport order: it fails at once, or when its vehicle has let it go."""
    _change(service, WITHDRAW, name, {"reason": reason}, version)


@app.command()
@of_service
def hold(
    service: Service,
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's reason and history.")] = None,
    by: By = None,
    immediate: Annotated[
        bool, typer.Option(help="Its robot is to stop; else it drives to the end of what it was given.")
    ] = True,
    version: Version = None,
) -> None:
    """Let a transport order wait until it is resumed; it keeps its vehicle, which stands."""
    body: dict[str, JsonValue] = {"by": by or getuser(), "immediate": immediate, "reason": reason}
    _change(service, HOLD, name, body, version)


@app.command()
@of_service
def resume(
    service: Service,
    name: Name,
    *,
    reason: Annotated[str | None, typer.Option(help="Why; stands in the order's history.")] = None,
    by: By = None,
    version: Version = None,
) -> None:
    """Let a held transport order go on from where its vehicle stands."""
    _change(service, RESUME, name, {"by": by or getuser(), "reason": reason}, version)


def _change(
    service: Service,
    operation: Operation[TransportOrderStatus],
    name: str,
    body: dict[str, JsonValue],
    version: int | None,
) -> None:
    """Have an order changed, only if it has that version still, and tell of it; what is None is left out."""
    given: dict[str, JsonValue] = {key: value for key, value in body.items() if value is not None}
    headers = {} if version is None else {"If-Match": f'"{version}"'}
    with service.connected() as connection:
        _put(service, connection.call(operation, name, body=given, headers=headers))


def _request(file: typer.FileBinaryRead | None, **fields: object) -> TransportOrderRequest:
    """Make a request of a file, or of what the options say."""
    if (file is None) == (not fields["destinations"]):
        message = "give stops, or --file"
        raise typer.BadParameter(message)
    try:
        if file:
            return TransportOrderRequest.model_validate_json(file.read(), by_alias=True, by_name=False)
        return TransportOrderRequest.model_validate(fields)
    except ValidationError as error:
        raise typer.BadParameter("; ".join(problems_of(error, TOLD))) from error


def put_or_watch(
    service: Service, connection: Connection, order: TransportOrderStatus, *, wait: bool
) -> None:
    """Tell of a new order; with ``wait`` of all that becomes of it, and by the exit status how it ended."""
    if wait:
        _watch_one(service, connection, order.name)
    else:
        _put(service, order)


def _watch_one(service: Service, connection: Connection, name: str) -> None:
    """Watch an order to its end; the exit status says whether it was done."""
    order = connection.call(SHOW_ORDER, name)
    if order.state.final:
        _put(service, order)
    else:
        query = {"kind": "transportOrder", "transportOrder": name}
        changes = watch(connection, _board(), query, as_json=service.as_json)
        order = next(each for each in changes if each.state.final)
        changes.close()
    if order.state is not TransportOrderState.FINISHED:
        give_up(f"{order.name} is {order.state}: {order.reason}", REFUSED)


def _orders(
    connection: Connection, query: dict[str, str | int | Sequence[str]]
) -> Iterator[TransportOrderStatus]:
    for page in connection.pages(LIST_ORDERS, query):
        yield from page.transport_orders


def _put(service: Service, *orders: TransportOrderStatus) -> None:
    service.put_all(orders, tables.orders_table)


def _board() -> Board[TransportOrderStatus]:
    return Board(TransportOrderStatus, tables.orders_table)
