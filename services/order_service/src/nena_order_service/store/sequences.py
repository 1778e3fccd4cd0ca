"""Reads and writes order sequences; every function blocks and belongs into a thread of the store."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Engine, func, select
from sqlalchemy.engine import Row

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.store import schema
from nena_order_service.store.statements import DatabaseRow, Statements, equals, execute
from nena_shared.fleet_api.transport_order import OrderSequenceStatus


@dataclass(frozen=True, slots=True)
class SequenceFilter:
    """Which sequences are asked for, newest first; ``before`` is the number of the last one had already."""

    finished: bool | None = None
    intended_vehicle: str | None = None
    before: int | None = None
    limit: int = 100


def write_sequences(connection: Connection, texts: Statements, sequences: Iterable[OrderSequence]) -> None:
    """Write sequences, new ones and new versions."""
    rows: list[DatabaseRow] = [
        {
            "number": sequence.number,
            "name": sequence.name,
            "idempotency_key": sequence.idempotency_key,
            "finished": sequence.status.finished,
            "intended_vehicle": sequence.status.intended_vehicle,
            "document": sequence.status.model_dump_json(by_alias=True),
        }
        for sequence in sequences
    ]
    execute(connection, texts.put_sequence, rows)


def read_unfinished_sequences(connection: Connection) -> tuple[OrderSequence, ...]:
    """Read all sequences that are not finished."""
    table = schema.order_sequences
    query = select(table).where(table.c.finished.is_(False)).order_by(table.c.number)
    return tuple(map(_sequence, connection.execute(query)))


def last_sequence(connection: Connection) -> int:
    """Give the greatest number that a sequence has; 0 for none."""
    return connection.execute(select(func.max(schema.order_sequences.c.number))).scalar() or 0


def read_sequence(
    engine: Engine, *, name: str | None = None, idempotency_key: str | None = None
) -> OrderSequence | None:
    """Read the sequence of this key, else of this name."""
    table = schema.order_sequences
    with engine.connect() as connection:
        for column, value in ((table.c.idempotency_key, idempotency_key), (table.c.name, name)):
            if value is not None:
                row = connection.execute(select(table).where(equals(column, value))).first()
                if row:
                    return _sequence(row)
    return None


def read_sequences(engine: Engine, wanted: SequenceFilter) -> tuple[OrderSequence, ...]:
    """Read a page of sequences, newest first."""
    table = schema.order_sequences
    query = select(table).order_by(table.c.number.desc()).limit(wanted.limit)
    if wanted.finished is not None:
        query = query.where(table.c.finished.is_(wanted.finished))
    if wanted.intended_vehicle is not None:
        query = query.where(equals(table.c.intended_vehicle, wanted.intended_vehicle))
    if wanted.before is not None:
        query = query.where(table.c.number < wanted.before)
    with engine.connect() as connection:
        return tuple(map(_sequence, connection.execute(query)))


def _sequence(row: Row[Any]) -> OrderSequence:
    status = OrderSequenceStatus.model_validate_json(row.document)
    return OrderSequence(row.number, status, row.idempotency_key)
