"""Download of maps and zone sets that fleet control requests."""

from __future__ import annotations

import asyncio
from enum import StrEnum
from hashlib import sha256
from http.client import HTTPConnection, HTTPException, HTTPResponse, HTTPSConnection
from ipaddress import IPv6Address, ip_address
from time import monotonic
from typing import Any, Final
from urllib.request import (
    HTTPDefaultErrorHandler,
    HTTPErrorProcessor,
    HTTPHandler,
    HTTPRedirectHandler,
    HTTPSHandler,
    OpenerDirector,
    ProxyHandler,
    Request,
    UnknownHandler,
)

from pydantic import Field

from nena_shared.settings import SettingsGroup

CHUNK: Final = 64 * 1024
HASH_LENGTH: Final = 64
"""Hexadecimal digits of a SHA-256."""


class DownloadSettings(SettingsGroup):
    """Download of maps and zone sets."""

    maximum_bytes: int = Field(
        64 * 1024 * 1024, ge=1024, le=4 * 1024**3, description="Maximum file size, bytes."
    )
    timeout: float = Field(60.0, gt=0, le=3600, description="Timeout of a download, seconds.")
    silence: float = Field(10.0, gt=0, le=600, description="Timeout without data, seconds.")


class DownloadError(Exception):
    """A file was not downloaded; the message contains the reason."""


async def download(link: str, digest: str | None, settings: DownloadSettings) -> bytes:
    """Fetch the file at ``link``, whose SHA-256 is ``digest`` (hexadecimal, None: not checked).

    Raises:
        DownloadError: it is missing, too large or too slow, or its hash differs.
    """
    if link.partition(":")[0].lower() not in ("http", "https"):
        raise DownloadError(f"only http and https links are allowed, not '{link}'")
    if digest is not None and len(digest) != HASH_LENGTH:
        raise DownloadError(f"the hash must be a SHA-256 in {HASH_LENGTH} hexadecimal digits")
    try:
        async with asyncio.timeout(settings.timeout):
            content = await asyncio.to_thread(_fetch_file, link, settings)
    except TimeoutError:
        raise DownloadError(f"{link} was not downloaded within {settings.timeout:g} s") from None
    except (OSError, HTTPException, ValueError) as error:
        raise DownloadError(f"{link} was not downloaded: {error}") from error
    if digest is not None and sha256(content).hexdigest() != digest.lower():
        raise DownloadError(f"the hash of {link} does not match")
    return content


def _fetch_file(link: str, settings: DownloadSettings) -> bytes:
    """Download the file, blocking; both timeouts end it even if the caller no longer waits."""
    request = Request(link, headers={"User-Agent": "nena-edge-agent"})  # noqa: S310 - the scheme was checked
    end = monotonic() + settings.timeout
    parts: list[bytes] = []
    size = 0
    try:
        with _make_opener().open(request, timeout=settings.silence) as answer:
            while part := answer.read1(CHUNK):
                parts.append(part)
                size += len(part)
                _check_size(link, size, end, settings)
            # read1 returns an early end of the connection as if it were the end of the file.
            if answer.length:
                raise DownloadError(f"{link} ended {answer.length} bytes early")
    except TimeoutError as error:
        raise DownloadError(f"{link} sent no data for {settings.silence:g} s") from error
    return b"".join(parts)


def _check_size(link: str, size: int, end: float, settings: DownloadSettings) -> None:
    """Raise DownloadError if the file is too large, or incomplete at the monotonic time ``end``."""
    if size > settings.maximum_bytes:
        raise DownloadError(f"{link} is larger than {settings.maximum_bytes} bytes")
    if monotonic() > end:
        raise DownloadError(f"{link} was not downloaded within {settings.timeout:g} s")


class _NetworkRange(StrEnum):
    """The network range of an address: redirects must not reach other hosts through the robot."""

    NETWORK = "the network"
    ROBOT = "the robot itself"
    LINK = "a link-local address"
    MULTICAST = "a multicast address"

    @classmethod
    def of_address(cls, address: str) -> _NetworkRange:
        """Return the range of an IP address."""
        # An IPv6 address may end with its zone: fe80::1%eth0 (RFC 4007, 11).
        host = ip_address(address.partition("%")[0])
        if isinstance(host, IPv6Address):
            # ::ffff:127.0.0.1 reaches 127.0.0.1 (RFC 4291, 2.5.5.2).
            host = host.ipv4_mapped or host
        # Linux connects to this machine for 0.0.0.0 and ::, too.
        if host.is_loopback or host.is_unspecified:
            return cls.ROBOT
        if host.is_link_local:
            return cls.LINK
        return cls.MULTICAST if host.is_multicast else cls.NETWORK


class _Connections:
    """Checks the connections of one download: the first one by the link, the others by redirects."""

    def __init__(self) -> None:
        self._first: _NetworkRange | None = None

    def begin_behind_proxy(self) -> None:
        """Record that the first connection is to a proxy, which is in the network."""
        self._first = self._first or _NetworkRange.NETWORK

    def check_address(self, address: str) -> None:
        """Check the address of a connection before anything is sent: names may resolve differently each time.

        Raises:
            DownloadError: the address is not allowed.
        """
        reach = _NetworkRange.of_address(address)
        if reach in (_NetworkRange.LINK, _NetworkRange.MULTICAST):
            raise DownloadError(f"downloads from {address} are not allowed: it is {reach}")
        if self._first is None:
            self._first = reach
        elif reach is _NetworkRange.ROBOT and self._first is not reach:
            raise DownloadError(f"the server redirects to {address}, which is {reach}")


class _Http(HTTPHandler):
    def __init__(self, connections: _Connections) -> None:
        super().__init__()
        self._connections = connections

    def http_open(self, req: Request) -> HTTPResponse:
        return self.do_open(_checked_connection(HTTPConnection, self._connections, req), req)


class _Https(HTTPSHandler):
    def __init__(self, connections: _Connections) -> None:
        super().__init__()
        self._connections = connections

    def https_open(self, req: Request) -> HTTPResponse:
        return self.do_open(_checked_connection(HTTPSConnection, self._connections, req), req)


def _checked_connection(
    kind: type[HTTPConnection], connections: _Connections, request: Request
) -> type[HTTPConnection]:
    """Return a connection class that checks its address, unless it connects to the site's proxy."""
    if request.has_proxy() or getattr(request, "_tunnel_host", None):
        connections.begin_behind_proxy()
        return kind

    class Checked(kind):  # type: ignore[misc, valid-type] # one of two that have the same interface
        def connect(self) -> None:
            super().connect()
            try:
                connections.check_address(self.sock.getpeername()[0])
            except DownloadError:
                self.close()
                raise

    return Checked


class _Redirects(HTTPRedirectHandler):
    max_redirections = 5

    def redirect_request(self, req: Request, *answer: Any) -> Request | None:  # noqa: ANN401
        new = super().redirect_request(req, *answer)
        # Without a mapHash or zoneSetHash, only TLS protects the file.
        if new is not None and req.type == "https" and new.type != "https":
            raise DownloadError(f"the server redirects from https to {new.full_url}")
        return new


def _make_opener() -> OpenerDirector:
    """Return an opener for http and https only: a server may redirect to other schemes."""
    opener = OpenerDirector()
    connections = _Connections()
    for handler in (
        ProxyHandler(),
        UnknownHandler(),
        _Http(connections),
        _Https(connections),
        HTTPDefaultErrorHandler(),
        _Redirects(),
        HTTPErrorProcessor(),
    ):
        opener.add_handler(handler)
    return opener
