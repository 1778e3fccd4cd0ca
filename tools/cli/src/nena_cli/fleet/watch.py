"""Orders and vehicles as they change."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator
from typing import Generic, TypeVar

from pydantic import BaseModel
from rich.console import Console
from rich.live import Live
from rich.table import Table

from nena_cli.fleet.connection import Connection
from nena_cli.fleet.events import Event, follow
from nena_cli.shell import put_json, say
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus

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
