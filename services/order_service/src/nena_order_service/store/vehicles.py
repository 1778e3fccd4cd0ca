"""Reads and writes what is known of vehicles."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import Connection, select

from nena_order_service.store import schema
from nena_order_service.store.changes import Document
from nena_order_service.store.statements import DatabaseRow, Statements, execute


def write_vehicles(connection: Connection, texts: Statements, documents: Mapping[str, Document]) -> None:
    """Replace the documents of these robots, by their keys."""
    rows: list[DatabaseRow] = [
        {"robot": robot, "document": document()} for robot, document in documents.items()
    ]
    execute(connection, texts.put_vehicle, rows)


def read_vehicles(connection: Connection) -> dict[str, str]:
    """Give all documents by the robots' keys."""
    return {row.robot: row.document for row in connection.execute(select(schema.vehicles))}
