"""Add order sequences."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add the table."""
    op.create_table(
        "order_sequences",
        sa.Column("number", sa.BigInteger(), primary_key=True, autoincrement=False),
        sa.Column("name", sa.String(200), nullable=False, unique=True),
        sa.Column("idempotency_key", sa.String(200), unique=True),
        sa.Column("finished", sa.Boolean(), nullable=False),
        sa.Column("intended_vehicle", sa.String(200)),
        sa.Column("document", sa.Text(), nullable=False),
    )
    op.create_index("order_sequences_by_finished", "order_sequences", ["finished", "number"])
