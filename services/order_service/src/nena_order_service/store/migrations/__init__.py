"""Alembic: what brings the tables of a store from release to release."""
