"""Serves an ASGI application inside a NeNa program, which keeps its own signals and log."""

from __future__ import annotations

import errno
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import uvicorn

from nena_shared.log import get_logger
from nena_shared.program import StartError
from nena_shared.settings import HttpSettings

log = get_logger(__name__)

GRACE = 2
"""Seconds that open requests have when the program ends."""


def listen(settings: HttpSettings) -> socket.socket:
    """Take the port, before anything else is started.

    Raises:
        StartError: somebody else has the port, or the address is not ours.

    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    try:
        return socket.create_server((settings.host, settings.port), family=family, backlog=128)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            reason = f"port {settings.port} of {settings.host} is in use; end the program that has it, "
            raise StartError(reason + "or choose another port with --http.port (0: any free one)") from error
        reason = f"cannot listen on {settings.host} port {settings.port}: {error.strerror}; "
        raise StartError(reason + "look at --http.host and --http.port") from error


class HttpServer(uvicorn.Server):
    """Serves on a socket that is open already; ends when :meth:`end` is called."""

    def __init__(self, app: Any) -> None:  # noqa: ANN401 - uvicorn's own type for an application
        super().__init__(
            uvicorn.Config(
                app,
                log_config=None,
                log_level="warning",
                access_log=False,
                lifespan="off",
                timeout_graceful_shutdown=GRACE,
            )
        )

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Begin to serve, and say where."""
        await super().startup(sockets)
        for each in sockets or ():
            host, port = each.getsockname()[:2]
            log.info("http listening", host=host, port=port)

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave the signals to the program."""
        yield

    def end(self) -> None:
        """Let :meth:`serve` finish the open requests and return."""
        self.should_exit = True
