"""Tables of the store, in SQL that SQLite and PostgreSQL both speak."""

from __future__ import annotations

from sqlalchemy import BigInteger, Column, ForeignKey, Index, Integer, MetaData, String, Table, Text

SCHEMA_VERSION = 1
"""One more with each change of the tables; a store of another version is refused."""

metadata = MetaData()

schema_version = Table("schema_version", metadata, Column("version", Integer, primary_key=True))

transport_orders = Table(
    "transport_orders",
    metadata,
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("name", String(200), nullable=False, unique=True),
    Column("idempotency_key", String(200), unique=True),
    Column("state", String(20), nullable=False),
    Column("intended_vehicle", String(200)),
    Column("document", Text, nullable=False),
    Index("transport_orders_by_state", "state", "number"),
    Index("transport_orders_by_vehicle", "intended_vehicle", "number"),
)
"""``document`` is the order as JSON, without its history."""

history = Table(
    "history",
    metadata,
    Column("order_number", BigInteger, ForeignKey("transport_orders.number"), primary_key=True),
    Column("entry", Integer, primary_key=True),
    Column("document", Text, nullable=False),
)

missions = Table(
    "missions",
    metadata,
    Column("order_number", BigInteger, ForeignKey("transport_orders.number"), primary_key=True),
    Column("document", Text, nullable=False),
)
"""What was last sent to a robot for each order that is not at its end."""
