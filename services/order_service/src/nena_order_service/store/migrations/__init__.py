"""Alembic migrations of the store's tables between releases."""
