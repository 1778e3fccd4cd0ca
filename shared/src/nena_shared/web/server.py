"""The HTTP server: uvicorn inside a program's own life, which keeps its own signals and log."""

from __future__ import annotations

import logging
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from starlette.types import ASGIApp, Receive, Scope, Send

from nena_shared.log import get_logger
from nena_shared.program import StartError
from nena_shared.settings import ConfigurationError
from nena_shared.web import connection
from nena_shared.web.connection import SELDOM, Connection, Listener
from nena_shared.web.exposure import check_exposure
from nena_shared.web.settings import HttpSettings

log = get_logger(__name__)

SHUTDOWN_TIMEOUT = 3
"""Seconds for open requests to end."""

BACKLOG = 1024
"""Connections that may wait to be accepted."""


class _Server(uvicorn.Server):
    """A server that leaves signals to the program, and accepts connections by :class:`Listener`."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Accept connections."""
        self.servers = [self._listener(each) for each in sockets or ()]  # type: ignore[misc]
        self.started = True

    def _listener(self, listening: socket.socket) -> Listener:
        config = self.config
        return Listener(
            listening,
            lambda: Connection(config, self.server_state, {}),
            encryption=config.ssl,
            per_address=None if config.proxy_headers else connection.PER_ADDRESS,
        )

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class HttpServer:
    """Listens from its making on, and answers while :meth:`run` runs."""

    def __init__(self, app: ASGIApp, settings: HttpSettings) -> None:
        """Take the port.

        Raises:
            ConfigurationError: the address is not protected as it must be, or the certificate is unusable.
            StartError: somebody else has the port, or the address is not ours.

        """
        check_exposure(settings)
        self.app = app
        """What answers; another may take its place while the server runs."""
        config = uvicorn.Config(
            self._answer,
            http=Connection,  # on h11; httptools, where it is there, loses bodies, and heads may have no end
            ws="none",
            interface="asgi3",
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=settings.reverse_proxy,
            forwarded_allow_ips="*",  # where a proxy is stated, nobody gets past it
            timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
            ssl_certfile=settings.tls_certificate,
            ssl_keyfile=settings.tls_key,
        )
        _load(config, settings)
        logging.getLogger("uvicorn.error").addFilter(SELDOM)
        self._server = _Server(config)
        self._host = settings.host
        self._scheme = "https" if settings.tls_certificate else "http"
        self._socket = _listen(settings)

    @property
    def port(self) -> int:
        """The TCP port, also where the settings leave it to the system."""
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def url(self) -> str:
        """Where it is found, as far as the settings tell."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"{self._scheme}://{host}:{self.port}"

    async def run(self) -> None:
        """Answer requests until :meth:`stop`."""
        log.info("http listening", url=self.url, port=self.port)
        await self._server.serve(sockets=[self._socket])

    def stop(self) -> None:
        """Take no more requests; :meth:`run` ends when those that are open are answered."""
        self._server.should_exit = True

    def close(self) -> None:
        """Give the port back, where :meth:`run` never ran."""
        self._socket.close()

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self.app(scope, receive, send)


def _load(config: uvicorn.Config, settings: HttpSettings) -> None:
    try:
        config.load()
    except (OSError, ssl.SSLError) as error:
        files = f"{settings.tls_certificate}, {settings.tls_key}"
        reason = error.reason if isinstance(error, ssl.SSLError) else error.strerror
        raise ConfigurationError([f"http.tls_certificate, http.tls_key: {files}: {reason}"]) from error
    if config.ssl:
        config.ssl.minimum_version = ssl.TLSVersion.TLSv1_2


def _listen(settings: HttpSettings) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # asyncio sets TCP_NODELAY only where the protocol is named; without it answers wait up to 44 ms
        listener = socket.socket(family, kind, socket.IPPROTO_TCP)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(BACKLOG)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        message = (
            f"cannot listen on {settings.host} port {settings.port}: {error.strerror}. "
            "Set http.port to a free port (0 takes any) or end the program that has it."
        )
        raise StartError(message) from error
    return listener
