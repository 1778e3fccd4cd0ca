"""The store: what must survive a restart, in a database by SQLAlchemy Core."""
