"""Stores: a file of SQLite, and a real PostgreSQL."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from support.postgres import Postgres


@pytest.fixture
def sqlite_url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/orders.db"


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest) -> str:
    if request.param == "sqlite":
        return str(request.getfixturevalue("sqlite_url"))
    server: Postgres = request.getfixturevalue("postgres")
    # A machine that stalls for seconds between two statements is no fault of the store.
    return f"{server.url}&options=-c%20idle_in_transaction_session_timeout%3D60000"


@pytest.fixture
def make_store(url: str) -> Iterator[Callable[[], Store]]:
    """Open the same store again and again, as restarts do."""
    stores: list[Store] = []

    def make() -> Store:
        stores.append(Store(open_database(url)))
        return stores[-1]

    yield make
    for store in stores:
        store.close()
