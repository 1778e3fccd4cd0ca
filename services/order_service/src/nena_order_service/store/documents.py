"""What hosts have put here as a whole, by kind and name."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy import Connection, Engine, select

from nena_order_service.store import schema
from nena_order_service.store.statements import DatabaseRow, Statements, execute


def write_documents(
    connection: Connection, texts: Statements, documents: Mapping[tuple[str, str], str | None]
) -> None:
    """Put documents, in place of those before; None: delete it."""
    put: list[DatabaseRow] = []
    gone: list[DatabaseRow] = []
    for (kind, name), document in documents.items():
        if document is None:
            gone.append({"kind": kind, "name": name})
        else:
            put.append({"kind": kind, "name": name, "document": document})
    execute(connection, texts.put_document, put)
    execute(connection, texts.forget_document, gone)


def read_documents(engine: Engine, kind: str) -> dict[str, str]:
    """Read all documents of a kind, by their names."""
    table = schema.documents
    with engine.connect() as connection:
        rows = connection.execute(select(table.c.name, table.c.document).where(table.c.kind == kind))
        return {row.name: row.document for row in rows}
