"""Databases for the history: a file of SQLite, and a real PostgreSQL."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Engine

from nena_status_aggregator.history import database
from support.postgres import Postgres


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path / 'history.db'}"
    server: Postgres = request.getfixturevalue("postgres")
    return server.url


@pytest.fixture
def engine(url: str) -> Iterator[Engine]:
    """Return an empty history."""
    made = database.make_engine(url)
    database.metadata.drop_all(made)
    database.prepare(made)
    yield made
    made.dispose()
