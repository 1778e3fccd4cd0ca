"""The store: everything that must survive a restart, in a database accessed by SQLAlchemy Core."""
