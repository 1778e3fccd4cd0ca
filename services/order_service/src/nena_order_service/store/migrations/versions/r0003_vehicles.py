"""Add the last known position of each robot, and what it does without an order."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Add the table; a robot is unknown until it reports again."""
    op.create_table(
        "vehicles",
        sa.Column("robot", sa.String(400), primary_key=True),
        sa.Column("document", sa.Text(), nullable=False),
    )
