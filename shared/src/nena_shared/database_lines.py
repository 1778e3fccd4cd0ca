"""The lines of a program to its database's server, to be ended where the server hangs without being gone."""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Any
from weakref import WeakKeyDictionary, WeakSet

_lines: WeakKeyDictionary[Any, WeakSet[Any]] = WeakKeyDictionary()
"""By SQLAlchemy's engine, the driver's own connections; weak references."""


def remember(engine: Any, connection: Any) -> None:  # noqa: ANN401 - SQLAlchemy's and its driver's, without either
    """Handle a connection with a ``fileno()``, for :func:`hang_up`."""
    _lines.setdefault(engine, WeakSet()).add(connection)


def hang_up(engine: Any) -> None:  # noqa: ANN401 - the same
    """Close the connections of an engine from any thread, at the end of the program.

    A server that hangs, as on a stalled disk, would block a thread that waits for its answer forever, and
    the program with it.
    """
    for connection in tuple(_lines.get(engine, ())):
        closed_meanwhile = suppress(OSError, engine.dialect.loaded_dbapi.Error)
        with closed_meanwhile, socket.socket(fileno=os.dup(connection.fileno())) as line:
            line.shutdown(socket.SHUT_RDWR)
