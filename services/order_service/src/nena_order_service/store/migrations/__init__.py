"""Migrations of a store of an older release, by Alembic: one module for each in ``versions``."""

from __future__ import annotations

import logging

import sqlalchemy as sa
from alembic import command
from alembic.config import Config
from alembic.util import CommandError

from nena_order_service.store.schema import StoreError

FIRST = "0001"
"""Revision of stores created before migrations existed, whose tables say version 1.

After a migration they say version 2, so that releases without migrations refuse tables that they do not know.
"""

STUCK_SECONDS = 60
"""Seconds after which PostgreSQL ends a migration that hangs; it changes documents between its statements."""


def upgrade(connection: sa.Connection, *, is_versioned: bool) -> None:
    """Migrate the tables to the last revision; unless ``is_versioned``, they are those of the first releases.

    Raises:
        StoreError: the tables are from a newer release, or from none.
        SQLAlchemyError: the database rejects the change.
    """
    logging.getLogger("alembic").setLevel(logging.WARNING)
    if connection.dialect.name == "postgresql":
        connection.execute(sa.text(f"SET LOCAL idle_in_transaction_session_timeout = '{STUCK_SECONDS}s'"))
    config = Config()
    config.set_main_option("script_location", "nena_order_service.store:migrations")
    config.attributes["connection"] = connection
    try:
        if not is_versioned:
            _require_first(connection)
            command.stamp(config, FIRST)
            connection.execute(sa.text("UPDATE schema_version SET version = 2"))
        command.upgrade(config, "head")
    except CommandError as error:
        message = (
            f"the store belongs to another release ({error}): "
            "use that release, restore a backup, or set another store.url"
        )
        raise StoreError(message) from error


def _require_first(connection: sa.Connection) -> None:
    version = connection.execute(sa.text("SELECT version FROM schema_version")).scalar()
    if version != 1:
        message = (
            f"the store has tables of version {version}, which no release has created: "
            "restore a backup, or set another store.url"
        )
        raise StoreError(message)
