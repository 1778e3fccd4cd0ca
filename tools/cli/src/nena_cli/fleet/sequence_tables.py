"""Order sequences as tables; names and reasons come from others, so no markup is read in them."""

from __future__ import annotations

from collections.abc import Iterable

from rich.table import Table
from rich.text import Text

from nena_shared.fleet_api.order_sequence import OrderSequenceStatus


def sequences_table(sequences: Iterable[OrderSequenceStatus]) -> Table:
    """Give a line for each sequence."""
    table = Table("sequence", "state", "vehicle", "orders", "created", "reason")
    for sequence in sequences:
        table.add_row(
            Text(sequence.name),
            Text(_state(sequence)),
            Text(sequence.processing_vehicle or _meant_for(sequence)),
            _orders(sequence),
            Text(f"{sequence.created.astimezone():%Y-%m-%d %H:%M:%S}"),
            Text(sequence.reason),
        )
    return table


def sequence_details(sequence: OrderSequenceStatus) -> Table:
    """Give all that is known of a sequence."""
    table = Table.grid(padding=(0, 2))
    rows = [
        ("sequence", Text(sequence.name)),
        ("state", Text(_state(sequence))),
        ("reason", Text(sequence.reason)),
        ("vehicle", Text(sequence.processing_vehicle or "")),
        ("intended vehicle", Text(sequence.intended_vehicle or "")),
        ("order types", Text(", ".join(sequence.order_types))),
        ("failure", Text("ends it" if sequence.failure_fatal else "is passed over")),
        ("orders", _orders(sequence)),
        ("properties", Text(", ".join(f"{each.key}={each.value}" for each in sequence.properties))),
    ]
    for name, value in rows:
        if value.plain:
            table.add_row(Text(name, style="dim"), value)
    return table


def sequence_history(sequence: OrderSequenceStatus) -> Table:
    """Give what has happened to a sequence."""
    table = Table("when", "what", "why", title="History", title_justify="left")
    for entry in sequence.history:
        when = f"{entry.timestamp.astimezone():%Y-%m-%d %H:%M:%S}"
        what = entry.event_code.removeprefix("nena:")
        table.add_row(Text(when), Text(what), Text(", ".join(entry.supplements)))
    return table


def _orders(sequence: OrderSequenceStatus) -> Text:
    """Give its orders; what is at its end is dim, whose turn it is stands out."""
    text = Text()
    turn = sequence.finished_index + 1
    for index, name in enumerate(sequence.orders):
        style = "dim" if index < turn else "bold" if index == turn else ""
        text.append(" > " if index else "").append(name, style=style)
    return text


def _state(sequence: OrderSequenceStatus) -> str:
    if sequence.finished:
        return "finished"
    return "complete" if sequence.complete else "open"


def _meant_for(sequence: OrderSequenceStatus) -> str:
    return f"({sequence.intended_vehicle})" if sequence.intended_vehicle else ""
