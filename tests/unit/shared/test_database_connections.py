from __future__ import annotations

import socket
from types import SimpleNamespace
from typing import Any

from nena_shared.database_connections import close_connections, register_connection
from support.waiting import PATIENCE


class ClosedError(Exception):
    """A driver's error for a closed connection."""


class Engine:
    dialect: Any = SimpleNamespace(loaded_dbapi=SimpleNamespace(Error=ClosedError))


class Closed:
    def fileno(self) -> int:
        raise ClosedError


def test_closing_connections_ends_waiting_threads() -> None:
    engine, (ours, servers), closed = Engine(), socket.socketpair(), Closed()
    register_connection(engine, closed)
    register_connection(engine, ours)
    with ours, servers:
        ours.settimeout(PATIENCE)
        close_connections(engine)

        assert ours.recv(1) == b""
        assert ours.fileno() >= 0, "to be closed by whoever opened it"


def test_only_an_engines_own_lines_are_hung_up() -> None:
    engine, (ours, servers) = Engine(), socket.socketpair()
    register_connection(engine, ours)
    with ours, servers:
        close_connections(Engine())

        servers.send(b"x")
        assert ours.recv(1) == b"x"
