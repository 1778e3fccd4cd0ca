"""Follow changes of orders or vehicles: a table that is redrawn on a terminal, lines into a pipe."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterator
from typing import Generic, TypeVar

from pydantic import BaseModel
from rich.console import Console, ConsoleOptions
from rich.live import Live
from rich.text import Text

from nena_cli.narrow import brief, is_too_wide, narrow
from nena_cli.options import Format
from nena_cli.output import echo, is_terminal, print_objects
from nena_cli.styled import Table
from nena_client import Client, Event
from nena_client.exchange import Query
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus

B = TypeVar("B", TransportOrderStatus, VehicleStatus)

ENDED_SHOWN = 10
"""Ended orders that stay on the screen."""


class Board(Generic[B]):
    """Screen content: the latest state of each order or vehicle."""

    def __init__(self, model: type[B], table: Callable[[Collection[B]], Table]) -> None:
        self._model: type[B] = model
        self.table: Callable[[Collection[B]], Table] = table
        self._shown: dict[str, B] = {}

    def take(self, event: Event) -> B:
        """Process an event and return its order or vehicle."""
        body: B = self._model.model_validate(event.data)
        self._shown.pop(body.name, None)
        self._shown[body.name] = body
        ended = [each.name for each in self._shown.values() if _is_over(each)]
        for name in ended[:-ENDED_SHOWN]:
            del self._shown[name]
        return body

    def __rich_console__(self, console: Console, _: ConsoleOptions) -> Iterator[Table | Text]:
        """Yield the table, in a form that fits the screen."""
        table = self.table(tuple(self._shown.values()))
        if not is_too_wide(table, console.width):
            yield table
            return
        lines = narrow(console, table)
        yield from lines if len(lines) < console.height else brief(console, table)


def watch(connection: Client, board: Board[B], query: Query, output: Format) -> Generator[B]:
    """Redraw a table on a terminal, else print each change; yield the changes until the caller stops."""
    if output is Format.WIDE:
        output = Format.TABLE  # its header would be repeated for each change
    events = connection.events(query, on_break=lambda why: echo(f"nena: reconnecting: {why}", "yellow"))
    changes = (board.take(event) for event in events if event.kind == query["kind"])
    if output is not Format.TABLE or not is_terminal():
        for body in changes:
            print_objects(output, (body,), board.table)
            yield body
        return
    with Live(board, refresh_per_second=8) as live:
        for body in changes:
            live.refresh()
            yield body


def _is_over(body: BaseModel) -> bool:
    return isinstance(body, TransportOrderStatus) and body.state.final
