"""The audit trail in the store: chain and write its rows, read pages of it, delete old rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import sqlalchemy as sa
from pydantic import ValidationError

from nena_order_service.store import schema
from nena_shared.clock import iso
from nena_shared.fleet_api.audit import (
    AuditEntry,
    AuditInterface,
    AuditMark,
    AuditPage,
    AuditQuery,
    AuditResult,
    hash_after,
)
from nena_shared.log import get_logger

log = get_logger(__name__)

KIND: Final = "audit"
"""Kind of the documents with the ends of the trail."""
LAST: Final = (KIND, "last")
"""Document that names the row that was written last, so that the removal of the last rows shows."""
DELETED: Final = (KIND, "deleted")
"""Document that names the last row that was deleted because of its age."""

DELETED_AT_ONCE: Final = 1000
"""Maximum number of rows deleted in one commit."""

NAME_LIMIT: Final = 200
TEXT_LIMIT: Final = 2000
"""Maximum length of texts, characters; longer ones are cut."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_MS = timedelta(milliseconds=1)


@dataclass(frozen=True, slots=True)
class AuditRow:
    """A row that is not chained yet."""

    time: datetime
    user: str
    interface: AuditInterface
    client: str
    operation: str
    object_kind: str
    object_name: str
    request: Callable[[], str]
    """Serialises the request; called by the writer."""
    before: str
    after: str
    result: AuditResult
    reason: str

    def to_columns(self) -> dict[str, object]:
        """Return the values of the table's columns, except those that chain rows."""
        try:
            request = self.request()
        except Exception:  # a request that cannot be shown must not hold up the commit
            log.exception("request not shown in the audit trail", operation=self.operation)
            request = ""
        return {
            "time": milliseconds(self.time),
            "user_name": storable_text(self.user, NAME_LIMIT),
            "interface": self.interface.value,
            "client": storable_text(self.client, 100),
            "operation": storable_text(self.operation, NAME_LIMIT),
            "object_kind": storable_text(self.object_kind, 50),
            "object_name": storable_text(self.object_name, NAME_LIMIT),
            "request": storable_text(request, TEXT_LIMIT),
            "state_before": storable_text(self.before, TEXT_LIMIT),
            "state_after": storable_text(self.after, TEXT_LIMIT),
            "result": self.result.value,
            "reason": storable_text(self.reason, TEXT_LIMIT),
        }


FIELDS: Final = {
    "user": "user_name",
    "object": "object_name",
    "objectKind": "object_kind",
    "before": "state_before",
    "after": "state_after",
    **{
        name: name for name in ("sequence", "interface", "client", "operation", "request", "result", "reason")
    },
}
"""Columns by the names that their fields have in the API, except ``timestamp`` and ``hash``."""


def storable_text(text: str, limit: int) -> str:
    """Return a text that any database can store: without NUL and surrogates, and cut to ``limit``."""
    # PostgreSQL's text has no NUL, and UTF-8 no lone surrogates; hosts can send both in JSON escapes.
    if len(text) > limit:
        end = f"… ({len(text)} characters)"
        text = text[: limit - len(end)] + end
    return text.encode("utf-8", "replace").decode().replace("\0", "�")


def milliseconds(moment: datetime) -> int:
    """Return a time in ms since 1970."""
    return (moment - _EPOCH) // _MS


def _as_json(values: Mapping[str, Any]) -> dict[str, object]:
    """Return a row's values as the fields of the API, without the hash."""
    fields: dict[str, object] = {name: values[column] for name, column in FIELDS.items()}
    return {**fields, "timestamp": iso(_EPOCH + values["time"] * _MS)}


class AuditChain:
    """Numbers and chains rows in the order of their commits; used by one thread only.

    The last row is kept in memory, so that the removal of rows during the run shows as a gap.
    """

    def __init__(self) -> None:
        self._last: AuditMark | None = None

    def chain_rows(
        self, connection: sa.Connection, rows: Sequence[Mapping[str, object]]
    ) -> tuple[list[dict[str, object]], AuditMark]:
        """Return the rows to insert, and the last one; ``rows`` are those of :meth:`AuditRow.to_columns`."""
        last = self._last
        if last is None:
            # The document knows the last row written, even if somebody has deleted it from the table.
            last = read_mark(connection, LAST)
            table = schema.audit
            query = sa.select(table.c.sequence, table.c.hash).order_by(table.c.sequence.desc()).limit(1)
            row = connection.execute(query).first()
            if row and row.sequence > last.sequence:
                last = AuditMark(sequence=row.sequence, hash=row.hash)
        chained = []
        for unchained in rows:
            values = {**unchained, "sequence": last.sequence + 1}
            values["hash"] = hash_after(last.hash, _as_json(values))
            last = AuditMark(sequence=last.sequence + 1, hash=str(values["hash"]))
            chained.append(values)
        self._last = last
        return chained, last

    def forget_last(self) -> None:
        """Read the last row again before the next commit, because the fate of the last one is unknown."""
        self._last = None


def read_mark(connection: sa.Connection, key: tuple[str, str]) -> AuditMark:
    """Return a row that a document names; the beginning without a readable document."""
    table = schema.documents
    query = sa.select(table.c.document).where(table.c.kind == key[0], table.c.name == key[1])
    document = connection.execute(query).scalar()
    try:
        return AuditMark.model_validate_json(document) if document else AuditMark()
    except ValidationError:
        return AuditMark()


def read_page(engine: sa.Engine, wanted: AuditQuery) -> AuditPage:
    """Read a page of the trail."""
    table = schema.audit
    columns: tuple[tuple[sa.Column[Any], str | None], ...] = (
        (table.c.user_name, wanted.user),
        (table.c.operation, wanted.operation),
        (table.c.object_name, wanted.object),
        (table.c.result, wanted.result and wanted.result.value),
    )
    query = sa.select(table).where(
        *(column == storable_text(value, NAME_LIMIT) for column, value in columns if value is not None)
    )
    if wanted.since is not None:
        query = query.where(table.c.time >= milliseconds(wanted.since))
    if wanted.until is not None:
        query = query.where(table.c.time < milliseconds(wanted.until))
    if wanted.after is not None:
        after = int(wanted.after)
        query = query.where(table.c.sequence > after if wanted.oldest_first else table.c.sequence < after)
    order = table.c.sequence if wanted.oldest_first else table.c.sequence.desc()
    if engine.dialect.name != "sqlite":
        # Rows and marks are read as of one moment, otherwise deletion meanwhile looks like a gap.
        # Transactions of SQLite always do that.
        engine = engine.execution_options(isolation_level="REPEATABLE READ")
    with engine.connect() as connection:
        rows = [
            dict(row) for row in connection.execute(query.order_by(order).limit(wanted.limit + 1)).mappings()
        ]
        last, deleted = read_mark(connection, LAST), read_mark(connection, DELETED)
    entries = tuple(
        AuditEntry.model_validate({**_as_json(row), "hash": row["hash"]}) for row in rows[: wanted.limit]
    )
    following = str(entries[-1].sequence) if len(rows) > wanted.limit else None
    return AuditPage(entries=entries, next=following, deleted=deleted, last=last)


def read_expired(engine: sa.Engine, before: datetime) -> AuditMark | None:
    """Return the last of the oldest rows that are from ``before`` this time; None if there is none.

    At most :data:`DELETED_AT_ONCE` rows count.
    """
    table, limit = schema.audit, milliseconds(before)
    query = sa.select(table.c.sequence, table.c.time, table.c.hash).order_by(table.c.sequence)
    expired = None
    with engine.connect() as connection:
        for row in connection.execute(query.limit(DELETED_AT_ONCE)):
            # A clock that was set back leaves old rows behind newer ones. They wait for these: the chain may
            # only lose its beginning.
            if row.time >= limit:
                break
            expired = AuditMark(sequence=row.sequence, hash=row.hash)
    return expired
