"""Tables of the history, in SQL that SQLite and PostgreSQL both speak."""

from __future__ import annotations

from sqlalchemy import BigInteger, Column, Index, Integer, MetaData, String, Table, Text

SCHEMA_VERSION = 1
"""One more with each change of the tables; a history of another version is refused."""

ROBOT_LENGTH = 300
ORDER_LENGTH = 600
"""Characters of names that are kept."""

metadata = MetaData()

schema_version = Table("history_schema_version", metadata, Column("version", Integer, primary_key=True))

happenings = Table(
    "happenings",
    metadata,
    # SQLite numbers rows by itself only in a column that is INTEGER to the letter.
    Column("id", BigInteger().with_variant(Integer, "sqlite"), primary_key=True, autoincrement=True),
    Column("time", BigInteger, nullable=False),
    Column("code", String(40), nullable=False),
    Column("robot", String(ROBOT_LENGTH)),
    Column("order_name", String(ORDER_LENGTH)),
    Column("text", Text, nullable=False),
    Column("details", Text, nullable=False),
    Index("happenings_by_time", "time"),
    Index("happenings_by_robot", "robot", "id"),
    Index("happenings_by_order", "order_name", "id"),
    Index("happenings_by_code", "code", "time"),
)
"""``time`` in ms since 1970 UTC; ``details`` are the values as JSON."""
