"""Mark the orders that the order service created itself, which only their names showed before."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"

NAMES = {"Park": re.compile(r"Park-[0-9a-f]{22}"), "Charge": re.compile(r"Recharge-[0-9a-f]{22}")}
"""Patterns of the names of automatic orders, by order type."""

ORDERS = sa.table(
    "transport_orders",
    sa.column("number", sa.BigInteger()),
    sa.column("name", sa.String()),
    sa.column("idempotency_key", sa.String()),
    sa.column("document", sa.Text()),
)


PAGE = 1000


def upgrade() -> None:
    """Mark the orders whose documents are exactly as the order service creates them."""
    connection = op.get_bind()
    named = sa.or_(ORDERS.c.name.startswith("Park-"), ORDERS.c.name.startswith("Recharge-"))
    query = sa.select(ORDERS.c.number, ORDERS.c.document).where(named, ORDERS.c.idempotency_key.is_(None))
    query, last = query.order_by(ORDERS.c.number).limit(PAGE), -1
    while rows := connection.execute(query.where(ORDERS.c.number > last)).all():
        for last, document in rows:
            status = json.loads(document)
            if _is_automatic(status):
                _note(connection, last, {**status, "automatic": True})


def _note(connection: sa.Connection, number: int, status: Mapping[str, Any]) -> None:
    changed = sa.update(ORDERS).where(ORDERS.c.number == number).values(document=json.dumps(status))
    connection.execute(changed)


def _is_automatic(status: Mapping[str, Any]) -> bool:
    """Return whether no host created the order: its name is generated, and it is never retried."""
    name = NAMES.get(status["type"])
    measures = [step.get("do") for step in status.get("onFailure") or ()]
    return (
        name is not None
        and name.fullmatch(status["name"]) is not None
        and status.get("intendedVehicle") is not None
        and len(status["driveOrders"]) == 1
        and measures == ["FAIL"]
    )
