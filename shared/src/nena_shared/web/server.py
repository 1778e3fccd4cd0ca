"""HTTP server with limits on connections, handshakes, heads and bodies, and a graceful start and stop."""

from __future__ import annotations

import asyncio
import re
import resource
import socket
import ssl
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import h11
import uvicorn
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from nena_shared.certificates import remember_http
from nena_shared.log import get_logger
from nena_shared.rate_limit import RateLimit
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import StartError, end
from nena_shared.web.settings import HttpSettings, check_exposure, network_of

log = get_logger(__name__)

HANDSHAKE_TIMEOUT = 5.0
"""Timeout of the TLS handshake, seconds from accepting the connection."""

KEEP_ALIVE = 75
"""Time for which an answered connection waits for the next request, seconds.

Longer than the 60 s of nginx and of cloud load balancers: a client that sends its request at the moment in
which the server closes the connection gets no answer.
"""

HEAD_TIMEOUT = 10.0
"""Timeout of a request's head, seconds from the connection or the first byte of a further request."""

BODY_TIMEOUT = 60.0
"""Timeout of a request's body, seconds from the end of its head."""

SHUTDOWN_TIMEOUT = 3
"""Time for open requests to finish at shutdown, seconds."""

PER_ADDRESS = 256
"""Maximum connections per address, counted from accept; not applied behind a proxy, which has one address.
Without it, one machine could exhaust the file descriptors of the process (1024 by default)."""

RESERVED_FILES = 128
"""File descriptors reserved for store, broker and log."""

BACKLOG = 1024
"""Maximum number of connections waiting to be accepted."""

NO_FILES_PAUSE = 1.0
"""Delay before accepting again when the system is out of file descriptors, seconds."""

STRICT_TRANSPORT_SECURITY: Final = (b"strict-transport-security", b"max-age=31536000")
BARE_LINE_FEED: Final = re.compile(rb"(?<!\r)\n")

_refusals_logged = RateLimit(rate=1 / 60, burst=1)


def most_connections() -> int:
    """Return the maximum number of connections that leaves enough file descriptors for everything else."""
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    # half of few files: the difference would leave no connections at all
    return max(allowed - RESERVED_FILES, allowed // 2)


class HttpConnection(H11Protocol):
    """uvicorn's connection with timeouts for heads and bodies, for which uvicorn waits forever."""

    def __init__(self, config: uvicorn.Config, state: ServerState, answers: Counter[int]) -> None:
        super().__init__(config, state, {})
        self.ended = asyncio.Event()
        self._answers = answers
        self._awaited: str | None = None
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Wait for the first request."""
        super().connection_made(transport)
        self._start_timeout("head")

    def handle_events(self) -> None:
        """Read what has arrived, and wait for the rest of the head or body.

        h11 reads lines that end without CR, which RFC 9112, 2.2 allows: a proxy may read them differently.
        """
        try:
            self._skip_late_body()
        except h11.RemoteProtocolError:
            self.transport.close()  # the request has its answer
            return
        # only where a head begins: a body may contain any byte
        head = self.conn.trailing_data[0].partition(b"\r\n\r\n")[0]
        if self.conn.their_state is h11.IDLE and BARE_LINE_FEED.search(head):
            self.send_400_response("A line ends without CR.")
        else:
            super().handle_events()
        if self.conn.their_state is h11.IDLE:
            self._start_timeout("head" if self.conn.trailing_data[0] else "next request")
        else:
            self._start_timeout("body" if self.conn.their_state is h11.SEND_BODY else None)

    def _skip_late_body(self) -> None:
        """Read the rest of a body whose request is answered, so that the next head is checked like the first.

        uvicorn would read that head in the same loop as the end of the body.
        """
        while self.conn.our_state is h11.DONE and self.conn.their_state is h11.SEND_BODY:
            event = self.conn.next_event()
            if event is h11.NEED_DATA:
                break
            if isinstance(event, h11.EndOfMessage):
                self.transport.resume_reading()
                self.conn.start_next_cycle()

    def send_400_response(self, msg: str) -> None:
        """Refuse a malformed request."""
        super().send_400_response(msg)
        self._answers[400] += 1

    def connection_lost(self, exc: Exception | None) -> None:
        """Tell that the connection has ended."""
        self._start_timeout(None)
        super().connection_lost(exc)
        self.ended.set()

    def _start_timeout(self, part: str | None) -> None:
        """Start the timeout of what is awaited; None: an answer, which may take its time."""
        # one deadline for each part: a client that sends byte by byte does not extend it
        if part == self._awaited:
            return
        if self._deadline is not None:
            self._deadline.cancel()
        self._awaited, self._deadline = part, None
        if part is not None:
            seconds = {"next request": KEEP_ALIVE, "head": HEAD_TIMEOUT, "body": BODY_TIMEOUT}[part]
            # abort: close() would first wait until such a client has read what is still to be sent
            self._deadline = self.loop.call_later(seconds, self.transport.abort)


class _Server(uvicorn.Server):
    """Leaves signals to the program."""

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class HttpServer:
    """Listens once created, and answers requests while :meth:`run` is running.

    It accepts connections itself: asyncio's server, which uvicorn starts otherwise, has no limits, waits a
    minute for TLS handshakes and tells of a connection only afterwards.
    """

    def __init__(self, app: ASGIApp, settings: HttpSettings) -> None:
        """Bind the port.

        Raises:
            ConfigurationError: the address lacks the required protection, or the certificate is unusable.
            StartError: the port is in use, or the address does not belong to this machine.
        """
        check_exposure(settings)
        self.app = app
        """The application; may be replaced while the server is running."""
        self.answers: Final[Counter[int]] = Counter()
        """Number of answers by status, including refusals."""
        self._settings = settings
        self._encryption = _load_encryption(settings)
        self._files = _file_versions(settings)
        self._server = _Server(
            uvicorn.Config(
                self._answer_request,
                # 0107: httptools drops the body of a request that offers an upgrade, as Java's client does
                http="h11",
                ws="none",
                interface="asgi3",
                lifespan="off",
                log_config=None,
                log_level="error",
                access_log=False,
                server_header=False,
                proxy_headers=settings.reverse_proxy,
                # rate limits go by the client's address, which others could choose by this header
                forwarded_allow_ips=[str(network) for network in settings.trusted_proxies],
                timeout_keep_alive=KEEP_ALIVE,
                timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
            )
        )
        self._server.config.load()
        self._open: Counter[str] = Counter()
        """Open connections by network."""
        self._connections: set[asyncio.Task[None]] = set()
        self._accepting: asyncio.Task[None] | None = None
        self._socket = _listen(settings)

    @property
    def port(self) -> int:
        """TCP port, also if the system chose it."""
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def url(self) -> str:
        """URL of the service, as far as the settings define it."""
        host = f"[{self._settings.host}]" if ":" in self._settings.host else self._settings.host
        return f"{'https' if self._encryption else 'http'}://{host}:{self.port}"

    async def run(self) -> None:
        """Answer requests until :meth:`stop` is called."""
        log.info("http listening", url=self.url, port=self.port)
        self._accepting = asyncio.create_task(self._accept_connections(), name="http accept")
        self._accepting.add_done_callback(
            lambda _: self.stop()
        )  # where it fails, too: run() raises its error
        try:
            await self._server.serve(sockets=[])
        finally:
            await end(self._accepting, *self._connections)
        if not self._accepting.cancelled():
            self._accepting.result()

    def stop(self) -> None:
        """Release the port; :meth:`run` ends when the open requests are answered."""
        self._server.should_exit = True
        if self._accepting:
            self._accepting.cancel()
        else:
            self._socket.close()

    async def _accept_connections(self) -> None:
        loop = asyncio.get_running_loop()
        with self._socket:
            while True:
                try:
                    accepted, address = await loop.sock_accept(self._socket)
                except ConnectionAbortedError:
                    continue
                except OSError as error:
                    # e.g. no free descriptor: the connection stays waiting, so this would spin
                    log.error("cannot accept connections, retrying", reason=error.strerror)  # noqa: TRY400
                    await asyncio.sleep(NO_FILES_PAUSE)
                    continue
                network = network_of(str(address[0]))
                if refusal := self._why_refused(network):
                    # without an answer, which would need a TLS handshake first
                    accepted.close()
                    if not _refusals_logged.wait(f"{refusal} {network}", loop.time()):
                        log.warning(refusal, address=str(address[0]))
                    continue
                self._open[network] += 1
                task = loop.create_task(self._hold_connection(accepted, network), name=f"http {network}")
                self._connections.add(task)
                task.add_done_callback(self._connections.discard)

    def _why_refused(self, network: str) -> str | None:
        """Return why no further connection is taken from a network."""
        if self._open[network] >= PER_ADDRESS and not self._settings.reverse_proxy:
            return "too many connections from one address; closing further ones"
        if len(self._connections) >= most_connections():
            return "too many connections; closing further ones"
        return None

    async def _hold_connection(self, accepted: socket.socket, network: str) -> None:
        """Hold a connection from accepting it to its end."""
        encryption = self._current_encryption()
        timeout = HANDSHAKE_TIMEOUT if encryption else None
        connection = HttpConnection(self._server.config, self._server.server_state, self.answers)
        try:
            transport, _ = await asyncio.get_running_loop().connect_accepted_socket(
                lambda: connection,  # what uvloop returns is its own SSLProtocol
                accepted,
                ssl=encryption,
                ssl_handshake_timeout=timeout,
                ssl_shutdown_timeout=timeout,
            )
            try:
                await connection.ended.wait()
            finally:
                transport.abort()
        except OSError:
            pass  # no TLS, timeout or disconnected: any client can cause this at will
        finally:
            self._open[network] -= 1
            if not self._open[network]:
                del self._open[network]

    def _current_encryption(self) -> ssl.SSLContext | None:
        """Return the TLS context of a new connection; renewed files are used without a restart."""
        files = _file_versions(self._settings)
        if files != self._files:
            self._files = files
            try:
                self._encryption = _load_encryption(self._settings)
            except ConfigurationError as error:  # such as a new certificate beside the key of the old one
                log.warning("renewed certificate not usable; the old one stays", reason=str(error))
            else:
                log.info("renewed certificate loaded", file=str(self._settings.tls_certificate))
        return self._encryption

    async def _answer_request(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_counted(message: Message) -> None:
            if message["type"] == "http.response.start":
                self.answers[message["status"]] += 1
                # RFC 6797, 7.2: not over HTTP
                if scope["scheme"] == "https":
                    message = {**message, "headers": [*message["headers"], STRICT_TRANSPORT_SECURITY]}
            await send(message)

        names = {name for name, _ in scope["headers"]}
        if {b"content-length", b"transfer-encoding"} <= names:  # ambiguous where it ends: RFC 9112, 6.3
            refusal = PlainTextResponse("Both Content-Length and Transfer-Encoding.", 400)
            # what follows may be the rest of this body or another request
            refusal.headers["connection"] = "close"
            await refusal(scope, receive, send_counted)
        else:
            await self.app(scope, receive, send_counted)


def _load_encryption(settings: HttpSettings) -> ssl.SSLContext | None:
    """Return a TLS context with the certificate of the settings; None: no TLS.

    Raises:
        ConfigurationError: the certificate or its key is unusable.
    """
    if settings.tls_certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        # without a passphrase, OpenSSL would ask on the terminal for that of an encrypted key
        context.load_cert_chain(settings.tls_certificate, settings.tls_key, password="")
    except (OSError, ssl.SSLError) as error:
        files = f"{settings.tls_certificate}, {settings.tls_key}"
        reason = error.reason if isinstance(error, ssl.SSLError) else error.strerror
        raise ConfigurationError([f"http.tls_certificate, http.tls_key: {files}: {reason}"]) from error
    remember_http(settings.tls_certificate)
    return context


def _file_versions(settings: HttpSettings) -> list[int]:
    """Return what changes with the files of certificate and key; nothing while one of them is missing."""
    files = (settings.tls_certificate, settings.tls_key)
    try:
        return [file.stat().st_mtime_ns for file in files if file]
    except OSError:
        return []


def _listen(settings: HttpSettings) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # asyncio sets TCP_NODELAY only if the protocol is given; without it responses take up to 44 ms longer
        listener = socket.socket(family, kind, socket.IPPROTO_TCP)
        try:
            listener.settimeout(0)
            # else a restart would fail while connections of the previous process are in TIME_WAIT
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(BACKLOG)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        raise StartError(
            f"cannot listen on {settings.host} port {settings.port}: {error.strerror}. "
            "Set http.port to a free port (0: any), or stop the program that uses it."
        ) from error
    return listener
