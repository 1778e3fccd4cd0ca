"""Create the tables of the first stores: orders, their histories and their missions."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Create the tables."""
    op.create_table(
        "transport_orders",
        sa.Column("number", sa.BigInteger(), primary_key=True, autoincrement=False),
        sa.Column("name", sa.String(200), nullable=False, unique=True),
        sa.Column("idempotency_key", sa.String(200), unique=True),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("intended_vehicle", sa.String(200)),
        sa.Column("document", sa.Text(), nullable=False),
    )
    op.create_index("transport_orders_by_state", "transport_orders", ["state", "number"])
    op.create_index("transport_orders_by_vehicle", "transport_orders", ["intended_vehicle", "number"])
    op.create_table(
        "history",
        sa.Column(
            "order_number", sa.BigInteger(), sa.ForeignKey("transport_orders.number"), primary_key=True
        ),
        sa.Column("entry", sa.Integer(), primary_key=True),
        sa.Column("document", sa.Text(), nullable=False),
    )
    op.create_table(
        "missions",
        sa.Column(
            "order_number", sa.BigInteger(), sa.ForeignKey("transport_orders.number"), primary_key=True
        ),
        sa.Column("document", sa.Text(), nullable=False),
    )
