"""Tables of the store, in SQL that SQLite and PostgreSQL both speak; ``migrations`` makes them."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    Text,
)

VERSION_TABLE = "order_service_version"
"""Where Alembic keeps the revision; a database may hold tables of other programs too, the aggregator's."""

metadata = MetaData()

transport_orders = Table(
    "transport_orders",
    metadata,
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("name", String(200), nullable=False, unique=True),
    Column("idempotency_key", String(200), unique=True),
    Column("state", String(20), nullable=False),
    Column("intended_vehicle", String(200)),
    Column("document", Text, nullable=False),
    Column("change_number", BigInteger, nullable=False, server_default="0"),
    Index("transport_orders_by_state", "state", "number"),
    Index("transport_orders_by_vehicle", "intended_vehicle", "number"),
    Index("transport_orders_by_change", "change_number"),
)
"""``document`` is the order as JSON, without its history; ``change_number`` counts the changes of all orders
and is that of this order's last one: who followed the orders up to some number has missed those above it."""

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

order_sequences = Table(
    "order_sequences",
    metadata,
    Column("number", BigInteger, primary_key=True, autoincrement=False),
    Column("name", String(200), nullable=False, unique=True),
    Column("idempotency_key", String(200), unique=True),
    Column("finished", Boolean, nullable=False),
    Column("intended_vehicle", String(200)),
    Column("document", Text, nullable=False),
    Index("order_sequences_by_finished", "finished", "number"),
)
"""``document`` is the order sequence as JSON, with its history."""

vehicles = Table(
    "vehicles",
    metadata,
    Column("robot", String(400), primary_key=True),
    Column("document", Text, nullable=False),
)
"""Where each robot was at last, and what it does without an order."""

path_locks = Table(
    "path_locks",
    metadata,
    Column("path", Text, primary_key=True),
    Column("locked", Boolean, nullable=False),
)
"""Paths that hosts have locked or unlocked; it counts more than the plant model."""

documents = Table(
    "documents",
    metadata,
    Column("kind", String(20), primary_key=True),
    Column("name", String(200), primary_key=True),
    Column("document", Text, nullable=False),
)
"""What hosts have put here as a whole: the plant model."""

leadership = Table(
    "leadership",
    metadata,
    Column("id", Integer, primary_key=True, autoincrement=False),
    Column("epoch", BigInteger, nullable=False),
    Column("commits", BigInteger, nullable=False),
    Column("url", Text, nullable=False),
)
"""One row. ``epoch`` counts the takings-over of a store that several order services share, ``commits`` the
commits of the one that is active, ``url`` is where hosts find it."""

LEADERSHIP_ID = 1
