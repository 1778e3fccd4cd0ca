"""Connections to a database server, which can be closed at the end even if the server hangs."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

_connections: WeakKeyDictionary[Any, WeakSet[Any]] = WeakKeyDictionary()
"""The driver's connections by SQLAlchemy engine, as weak references."""


def register_connection(engine: Any, connection: Any) -> None:  # noqa: ANN401 - of optional libraries
    """Register a connection with a ``fileno()`` for :func:`close_connections`."""
    _connections.setdefault(engine, WeakSet()).add(connection)


def close_connections(engine: Any) -> None:  # noqa: ANN401 - the same
    """Close the connections of an engine at the end of the program. Thread-safe.

    Otherwise a server that hangs, e.g. on a stalled disk, would block the thread that waits for it, and thus
    the end of the program.
    """
    for connection in tuple(_connections.get(engine, ())):
        closed_meanwhile = suppress(OSError, engine.dialect.loaded_dbapi.Error)
        # a duplicate: at the end of the block the driver's own descriptor must stay open
        with closed_meanwhile, socket.socket(fileno=os.dup(connection.fileno())) as opened:
            opened.shutdown(socket.SHUT_RDWR)
