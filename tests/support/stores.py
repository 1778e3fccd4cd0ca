"""Stores of the order service, also such as older releases have made."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.store.changes import Changes

FIRST_STORE = Path(__file__).parents[1] / "fixtures" / "stores" / "version_1.sql"


def first_store(url: str) -> Path:
    """Put the store of a first release, which was killed at work, where a SQLite URL says; give the file."""
    file = Path(url.removeprefix("sqlite:///"))
    with sqlite3.connect(file) as store:
        store.executescript(FIRST_STORE.read_text(encoding="utf-8"))
    return file


def changes(*versions: tuple[TransportOrder, TransportOrder | None]) -> Changes:
    """Give the changes that lead to each order from the version before it; None: it is new."""
    made = Changes()
    for order, before in versions:
        made.put_order(order, before)
    return made
