"""Add change numbers for event streams, vehicles, path locks, and the leader of a shared store."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Add the tables; existing orders count as changed in the order of their creation."""
    op.add_column(
        "transport_orders", sa.Column("change_number", sa.BigInteger(), nullable=False, server_default="0")
    )
    op.execute("UPDATE transport_orders SET change_number = number")
    op.create_index("transport_orders_by_change", "transport_orders", ["change_number"])
    op.create_table(
        "path_locks",
        sa.Column("path", sa.Text(), primary_key=True),
        sa.Column("locked", sa.Boolean(), nullable=False),
    )
    leadership = op.create_table(
        "leadership",
        sa.Column("id", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("epoch", sa.BigInteger(), nullable=False),
        sa.Column("commits", sa.BigInteger(), nullable=False),
        sa.Column("url", sa.Text(), nullable=False),
    )
    op.bulk_insert(leadership, [{"id": 1, "epoch": 0, "commits": 0, "url": ""}])
