"""Migrate the tables of the given connection to the requested revision; run by Alembic."""

from __future__ import annotations

from alembic import context

from nena_order_service.store import schema

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=schema.metadata,
    version_table=schema.VERSION_TABLE,
    transactional_ddl=True,
)
with context.begin_transaction():
    context.run_migrations()
