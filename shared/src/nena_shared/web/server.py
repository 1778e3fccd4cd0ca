"""HTTP server with limits on connections, handshakes and bodies, and a graceful start and stop."""

from __future__ import annotations

import asyncio
import logging
import re
import resource
import socket
import ssl
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any, Final

import h11
import uvicorn
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.server import ServerState

from nena_shared.certificates import remember_http
from nena_shared.log import get_logger
from nena_shared.program import StartError
from nena_shared.rate_limit import RateLimit
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import end
from nena_shared.web.settings import HttpSettings, check_exposure, network_of

log = get_logger(__name__)

HANDSHAKE_TIMEOUT = 5.0
"""Timeout of the TLS handshake, seconds from accepting the connection."""

HEAD_TIMEOUT = 10.0
"""Timeout of a request's head, seconds from the connection or the first byte of the head."""

BODY_TIMEOUT = 60.0
"""Timeout of a request's body, seconds from the end of its head."""

PER_ADDRESS = 256
"""Maximum connections per address, counted from accept; not applied behind a proxy, which has one address.
Without it, one machine could exhaust the file descriptors of the process (1024 by default)."""

RESERVED_FILES = 128
"""File descriptors reserved for store, broker and log."""

ACCEPTED_AT_ONCE = 64
"""Maximum connections accepted in one iteration of the event loop."""

NO_FILES_PAUSE = 1.0
"""Delay before accepting again when the system is out of file descriptors, seconds."""

_logged = RateLimit(rate=1 / 60, burst=1)


class _Seldom(logging.Filter):
    """Passes equal warnings once a minute; otherwise every malformed request would log a line."""

    def __init__(self) -> None:
        super().__init__()
        self._passed: Final = RateLimit(rate=1 / 60, burst=1)

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is logged; errors always are."""
        return record.levelno > logging.WARNING or not self._passed.wait(str(record.msg), time.monotonic())


SELDOM: Final = _Seldom()
"""Filter of uvicorn's log."""


def most_connections() -> int:
    """Return the maximum number of connections that leaves enough file descriptors for everything else."""
    allowed, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return max(allowed - RESERVED_FILES, allowed // 2)


_BARE_LINE_FEED: Final = re.compile(rb"(?<!\r)\n")
_LENGTHS: Final = frozenset({b"content-length", b"transfer-encoding"})


class HttpConnection(H11Protocol):
    """uvicorn's HTTP protocol with timeouts for heads and bodies, for which uvicorn waits forever."""

    release: Callable[[], None] | None = None
    """Called when the connection has ended."""
    _deadline: asyncio.TimerHandle | None = None
    _awaited: type[h11.IDLE | h11.SEND_BODY] | None = None
    _head = b""
    """The head of a response, kept to be written together with its body."""

    def __init__(self, config: uvicorn.Config, state: ServerState, answers: Counter[int]) -> None:
        """``answers`` counts the answers by status."""
        super().__init__(config, state, {})
        self._answers = answers

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start waiting for the first request."""
        super().connection_made(transport)
        self._next_event, self.conn.next_event = self.conn.next_event, self._unambiguous  # type: ignore[method-assign]
        self._encode, self.conn.send = self.conn.send, self._joined  # type: ignore[assignment, method-assign]
        self._await(h11.IDLE)

    def data_received(self, data: bytes) -> None:
        """Read a part of a request."""
        super().data_received(data)
        state = self.conn.their_state
        self._await(state if state in (h11.IDLE, h11.SEND_BODY) else None)

    def on_response_complete(self) -> None:
        """Continue reading; the timeout also applies to a pipelined request."""
        super().on_response_complete()
        if self.conn.their_state is h11.SEND_BODY:
            self._await(h11.SEND_BODY)

    def connection_lost(self, exc: Exception | None) -> None:
        """Release the connection."""
        self._await(None)
        super().connection_lost(exc)
        if self.release:
            self.release()

    def _unambiguous(self) -> Any:  # noqa: ANN401 - as h11 has it
        """Return the next event; reject heads that a proxy may parse differently (RFC 9112, 6.3)."""
        if self.conn.their_state is h11.IDLE:
            head = self.conn.trailing_data[0].partition(b"\r\n\r\n")[0]
            if _BARE_LINE_FEED.search(head):
                message = "a line ends without CR"
                raise h11.RemoteProtocolError(message)
        event = self._next_event()
        if type(event) is h11.Request and len(_names_of(event) & _LENGTHS) > 1:
            message = "both Content-Length and Transfer-Encoding"
            raise h11.RemoteProtocolError(message)
        return event

    def _joined(self, event: h11.Event) -> bytes | None:
        """Return the bytes to write now: the head of a response of known length waits for its body."""
        data = self._encode(event)
        if type(event) is h11.Response:  # isinstance() of h11's abstract classes is slow
            self._answers[event.status_code] += 1
            if b"content-length" in _names_of(event):
                self._head = data or b""
                return b""
        data, self._head = self._head + (data or b""), b""
        return data

    def _unsupported_upgrade_warning(self) -> None:
        """Suppress the warning: Java's client offers HTTP/2 with each request, but also accepts HTTP/1.1."""

    def _await(self, part: type[h11.IDLE | h11.SEND_BODY] | None) -> None:
        """Start the timeout of this part of a request; None: no timeout."""
        if part is self._awaited:
            return
        if self._deadline is not None:
            self._deadline.cancel()
        self._awaited = part
        seconds = BODY_TIMEOUT if part is h11.SEND_BODY else HEAD_TIMEOUT
        self._deadline = self.loop.call_later(seconds, self.transport.abort) if part else None


def _names_of(event: h11.Request | h11.Response) -> set[bytes]:
    """Return the names of the headers; iterating over h11's own takes two function calls for each."""
    return {name.lower() for name, _ in event.headers.raw_items()}


class Listener:
    """Accepts connections, and counts them before their TLS handshake.

    asyncio's server reports a connection only after its handshake, so clients that never start one would not
    be counted, and not be closed for a minute.
    """

    def __init__(
        self,
        listening: socket.socket,
        make: Callable[[], HttpConnection],
        *,
        encryption: Callable[[], ssl.SSLContext | None],
        per_address: int | None,
    ) -> None:
        """Start accepting connections.

        Args:
            listening: the listening socket; closed by the caller.
            make: creates the protocol of a connection.
            encryption: returns the TLS context of a new connection; None: no TLS.
            per_address: maximum connections per address; None: no limit, as behind a proxy.
        """
        self._socket = listening
        self._make = make
        self._encryption = encryption
        self._per_address = per_address
        self._most = most_connections()
        self._open: defaultdict[str, set[socket.socket]] = defaultdict(set)
        self._count = 0
        self._handshakes: set[asyncio.Task[None]] = set()
        self._resuming: asyncio.TimerHandle | None = None
        self._loop = asyncio.get_running_loop()
        listening.settimeout(0)
        self._resume()

    def close(self) -> None:
        """Stop accepting connections, and abort unfinished handshakes."""
        self._loop.remove_reader(self._socket)
        if self._resuming:
            self._resuming.cancel()
        for each in self._handshakes:
            each.cancel()

    async def wait_closed(self) -> None:
        """Wait until the aborted handshakes have ended."""
        await asyncio.gather(*self._handshakes, return_exceptions=True)

    def _resume(self) -> None:
        self._loop.add_reader(self._socket, self._accept)

    def _accept(self) -> None:
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                accepted, address = self._socket.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                log.error("cannot accept connections, retrying", reason=error.strerror)  # noqa: TRY400
                self._loop.remove_reader(self._socket)
                self._resuming = self._loop.call_later(NO_FILES_PAUSE, self._resume)
                return
            self._take(accepted, str(address[0]))

    def _take(self, accepted: socket.socket, address: str) -> None:
        network = network_of(address)
        of_network = len(self._open[network]) if network in self._open else 0
        if self._per_address is not None and of_network >= self._per_address:
            self._refuse(accepted, "too many connections from one address; closing further ones", address)
        elif self._count >= self._most:
            self._refuse(accepted, "too many connections; closing further ones", address)
        else:
            accepted.settimeout(0)
            self._open[network].add(accepted)
            self._count += 1
            task = self._loop.create_task(self._begin(accepted, network), name=f"accept {address}")
            self._handshakes.add(task)
            task.add_done_callback(self._handshakes.discard)

    def _refuse(self, accepted: socket.socket, event: str, address: str) -> None:
        accepted.close()
        if not _logged.wait(f"{event} {address}", self._loop.time()):
            log.warning(event, address=address)

    async def _begin(self, accepted: socket.socket, network: str) -> None:
        release = partial(self._release, accepted, network)

        def make() -> HttpConnection:
            made = self._make()
            made.release = release
            return made

        encryption = self._encryption()
        timeout = HANDSHAKE_TIMEOUT if encryption else None
        try:
            await self._loop.connect_accepted_socket(
                make,
                accepted,
                ssl=encryption,
                ssl_handshake_timeout=timeout,
                ssl_shutdown_timeout=timeout,
            )
        except OSError:  # no TLS, timeout or disconnected: any client can cause this at will
            release()
        except BaseException:
            release()
            raise

    def _release(self, accepted: socket.socket, network: str) -> None:
        of_network = self._open.get(network, set())
        if accepted in of_network:
            of_network.remove(accepted)
            self._count -= 1
            if not of_network:
                del self._open[network]


SHUTDOWN_TIMEOUT = 3
"""Time for open requests to finish at shutdown, seconds."""

RENEWAL_INTERVAL = 5.0
"""Seconds between two looks at the files of certificate and key."""

BACKLOG = 1024
"""Maximum number of connections waiting to be accepted."""


class _Server(uvicorn.Server):
    """A uvicorn server that leaves signals to the program and accepts connections with :class:`Listener`."""

    def __init__(self, config: uvicorn.Config, encryption: ssl.SSLContext | None) -> None:
        super().__init__(config)
        self.encryption = encryption
        """TLS context of new connections; None: no TLS."""
        self.answers: Final[Counter[int]] = Counter()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start accepting connections."""
        self.servers = [self._listener(each) for each in sockets or ()]  # type: ignore[misc]
        self.started = True

    def _listener(self, listening: socket.socket) -> Listener:
        return Listener(
            listening,
            lambda: HttpConnection(self.config, self.server_state, self.answers),
            encryption=lambda: self.encryption,
            per_address=None if self.config.proxy_headers else PER_ADDRESS,
        )

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


class HttpServer:
    """Listens once created, and answers requests while :meth:`run` is running."""

    def __init__(self, app: ASGIApp, settings: HttpSettings) -> None:
        """Bind the port.

        Raises:
            ConfigurationError: the address lacks the required protection, or the certificate is unusable.
            StartError: the port is in use, or the address does not belong to this machine.
        """
        check_exposure(settings)
        self.app = app
        """The application; may be replaced while the server is running."""
        config = uvicorn.Config(
            self._answer,
            http=HttpConnection,  # based on h11, as httptools loses bodies and does not limit heads
            ws="none",
            interface="asgi3",
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=settings.reverse_proxy,
            forwarded_allow_ips=[str(each) for each in settings.trusted_proxies],
            timeout_graceful_shutdown=SHUTDOWN_TIMEOUT,
        )
        config.load()
        self._settings = settings
        self._loaded = _version(settings)
        logging.getLogger("uvicorn.error").addFilter(SELDOM)
        self._server = _Server(config, _encryption(settings))
        self._host = settings.host
        self._scheme = "https" if settings.tls_certificate else "http"
        self._socket = _listen(settings)

    @property
    def answers(self) -> Counter[int]:
        """Number of answers by status, including refusals."""
        return self._server.answers

    @property
    def port(self) -> int:
        """TCP port, also if the system chose it."""
        port: int = self._socket.getsockname()[1]
        return port

    @property
    def url(self) -> str:
        """URL of the service, as far as the settings define it."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        return f"{self._scheme}://{host}:{self.port}"

    async def run(self) -> None:
        """Answer requests until :meth:`stop` is called."""
        log.info("http listening", url=self.url, port=self.port)
        renewing = asyncio.create_task(self._renew(), name="http certificate")
        try:
            await self._server.serve(sockets=[self._socket])
        finally:
            await end(renewing)

    def stop(self) -> None:
        """Stop accepting requests; :meth:`run` ends when the open ones are answered."""
        self._server.should_exit = True

    def close(self) -> None:
        """Release the port if :meth:`run` was never called."""
        self._socket.close()

    async def _renew(self) -> None:
        """Use a renewed certificate for new connections, without a restart."""
        refused = None
        while self._settings.tls_certificate:
            await asyncio.sleep(RENEWAL_INTERVAL)
            found = await asyncio.to_thread(_version, self._settings)
            if found in (self._loaded, refused):
                continue
            try:
                self._server.encryption = await asyncio.to_thread(_encryption, self._settings)
            except ConfigurationError as error:  # such as a new certificate beside the key of the old one
                refused = found
                log.warning("renewed certificate not usable; the old one stays", reason=str(error))
            else:
                self._loaded = found
                log.info("renewed certificate loaded", file=str(self._settings.tls_certificate))

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self.app(scope, receive, _strictly(send) if scope.get("scheme") == "https" else send)


STRICT_TRANSPORT_SECURITY: Final = (b"strict-transport-security", b"max-age=31536000")


def _strictly(send: Send) -> Send:
    """Add HSTS, so that browsers only use TLS for a year."""

    async def send_strictly(message: Message) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), STRICT_TRANSPORT_SECURITY]}
        await send(message)

    return send_strictly


def _encryption(settings: HttpSettings) -> ssl.SSLContext | None:
    """Return a TLS context with the certificate of the settings; None: no TLS.

    Raises:
        ConfigurationError: the certificate or its key is unusable.
    """
    if settings.tls_certificate is None:
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        context.load_cert_chain(settings.tls_certificate, settings.tls_key, password=_no_passphrase)
    except (OSError, ssl.SSLError) as error:
        files = f"{settings.tls_certificate}, {settings.tls_key}"
        reason = error.reason if isinstance(error, ssl.SSLError) else error.strerror
        raise ConfigurationError([f"http.tls_certificate, http.tls_key: {files}: {reason}"]) from error
    remember_http(settings.tls_certificate)
    return context


def _no_passphrase() -> str:
    """Return no passphrase for an encrypted key, for which OpenSSL would ask on the terminal."""
    return ""


def _version(settings: HttpSettings) -> tuple[object, ...]:
    """Return what changes with the files of certificate and key."""
    found: list[object] = []
    for file in (settings.tls_certificate, settings.tls_key):
        if file:
            with suppress(OSError):
                status = file.stat()
                found += (status.st_ino, status.st_size, status.st_mtime_ns)
    return tuple(found)


def _listen(settings: HttpSettings) -> socket.socket:
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        # asyncio sets TCP_NODELAY only if the protocol is given; without it responses take up to 44 ms longer
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
            "Set http.port to a free port (0: any), or stop the program that uses it."
        )
        raise StartError(message) from error
    return listener
