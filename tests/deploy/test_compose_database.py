"""The script by which docker-compose's PostgreSQL makes the services' user, at a real PostgreSQL."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import NullPool, create_engine, text
from sqlalchemy.exc import DBAPIError

from nena_order_service.store.schema import open_database
from support.postgres import Postgres
from support.waiting import PATIENCE

SCRIPT = Path(__file__).parents[2] / "deploy/containers/postgres/nena.sql"

pytestmark = pytest.mark.postgres


@pytest.fixture(scope="module")
def made() -> Iterator[Postgres]:
    server = Postgres("postgres")
    as_image = "psql -v ON_ERROR_STOP=1 --no-psqlrc --username postgres --no-password --dbname postgres -f"
    done = subprocess.run(
        [*as_image.split(), SCRIPT],
        env={**server.environment, "POSTGRES_PASSWORD": "it's secret"},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    yield server
    server.close()


def value(url: str, statement: str) -> object:
    with create_engine(url, poolclass=NullPool, isolation_level="AUTOCOMMIT").connect() as connection:
        return connection.execute(text(statement)).scalar()


def test_service_user_owns_its_database_and_is_not_a_superuser(made: Postgres) -> None:
    rights = "rolsuper OR rolcreaterole OR rolcreatedb OR rolreplication OR rolbypassrls"
    url = made.url_of("nena", "nena")
    assert value(url, f"SELECT {rights} FROM pg_roles WHERE rolname = 'nena'") is False  # noqa: S608 - our own
    for statement in (
        "COPY (SELECT 1) TO PROGRAM 'id'",
        "SELECT pg_read_file('/etc/passwd')",
        "CREATE ROLE another SUPERUSER",
        "ALTER ROLE nena SUPERUSER",
    ):
        with pytest.raises(DBAPIError, match="InsufficientPrivilege"):
            value(url, statement)


def test_both_passwords_work(made: Postgres) -> None:
    password = "SELECT rolpassword LIKE 'SCRAM-SHA-256$%' FROM pg_authid WHERE rolname = '{}'"
    assert value(made.url, password.format("nena")) is True
    assert value(made.url, password.format("postgres")) is None, "the superuser has none"


def test_order_service_creates_its_tables(made: Postgres) -> None:
    open_database(made.url_of("nena", "nena")).dispose()
    assert value(made.url_of("nena", "nena"), "SELECT count(*) FROM leadership") == 1
