"""Brings the tables of a store to what this program needs, whatever release has made them."""

from __future__ import annotations

import logging

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.util import CommandError
from sqlalchemy import Connection, Engine, inspect, text

from nena_order_service.store import schema
from nena_order_service.store.errors import StoreError
from nena_shared.log import get_logger

log = get_logger(__name__)

FIRST = "0001"
"""The tables of stores that were made before there were migrations; they say version 1.

Brought up to date they say 2: releases from then look there, and would work on tables that they do not know.
"""


def migrate(engine: Engine) -> None:
    """Make or change the tables in one transaction: all of it or nothing.

    Raises:
        StoreError: the tables are of a newer release.
        SQLAlchemyError: the database takes no change.

    """
    logging.getLogger("alembic").setLevel(logging.WARNING)
    with engine.begin() as connection:
        config = Config()
        config.set_main_option("script_location", "nena_order_service.store:migrations")
        config.attributes["connection"] = connection
        before = _revision(connection)
        try:
            if _is_from_before_migrations(connection):
                command.stamp(config, FIRST)
                connection.execute(text("UPDATE schema_version SET version = 2"))
            command.upgrade(config, "head")
        except CommandError as error:
            message = (
                f"the tables of the store are of another release ({error}): "
                "use the release that made the store, go back to a copy of it, or name another store.url"
            )
            raise StoreError(message) from error
        if before != (now := _revision(connection)):
            log.info("the tables of the store are brought up to date", before=before, now=now)


def _revision(connection: Connection) -> str | None:
    options = {"version_table": schema.VERSION_TABLE}
    return MigrationContext.configure(connection, opts=options).get_current_revision()


def _is_from_before_migrations(connection: Connection) -> bool:
    tables = set(inspect(connection).get_table_names())
    if schema.VERSION_TABLE in tables or not tables >= {"schema_version", "transport_orders"}:
        return False
    version = connection.execute(text("SELECT version FROM schema_version")).scalar()
    if version == 1:
        return True
    message = (
        f"the store has tables of version {version}, which no release has made: "
        "go back to a copy of it, or name another store.url"
    )
    raise StoreError(message)
