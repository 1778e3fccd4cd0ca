from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx
import pytest
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send

from nena_shared.program import StartError
from nena_shared.settings import ConfigurationError
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.certificates import Authority
from support.waiting import PATIENCE

YES = PlainTextResponse("yes")


@asynccontextmanager
async def serving(settings: HttpSettings) -> AsyncIterator[HttpServer]:
    server = HttpServer(YES, settings)
    task = asyncio.create_task(server.run())
    try:
        yield server
    finally:
        server.stop()
        await asyncio.wait_for(task, PATIENCE)


async def test_answers_on_a_free_port_until_it_is_stopped() -> None:
    async with serving(HttpSettings(port=0)) as server, httpx.AsyncClient(timeout=PATIENCE) as client:
        assert (await client.get(server.url)).text == "yes"
        server.app = PlainTextResponse("another")
        assert (await client.get(server.url)).text == "another"


async def test_with_a_certificate_it_speaks_https(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    files = authority.sign("server")
    settings = HttpSettings(port=0, tls_certificate=files.certificate, tls_key=files.key)
    trusting = ssl.create_default_context(cafile=authority.ca)
    async with serving(settings) as server, httpx.AsyncClient(verify=trusting, timeout=PATIENCE) as client:
        assert server.url.startswith("https://127.0.0.1:")
        assert (await client.get(server.url)).text == "yes"
        with pytest.raises(httpx.HTTPError):
            await client.get(server.url.replace("https", "http"))


@pytest.mark.parametrize(
    "offer", ["", "Connection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\nHTTP2-Settings: AA\r\n"]
)
async def test_bodies_are_read_also_of_hosts_that_offer_http_2(offer: str) -> None:
    """Java's client offers it with each request where there is no TLS."""

    async def echo(scope: Scope, receive: Receive, send: Send) -> None:
        await PlainTextResponse(await Request(scope, receive).body())(scope, receive, send)

    async with serving(HttpSettings(port=0)) as server:
        server.app = echo
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        for _ in range(2):
            writer.write(f"POST / HTTP/1.1\r\nHost: a\r\n{offer}Content-Length: 4\r\n\r\nbody".encode())
            head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), PATIENCE)
            assert head.startswith(b"HTTP/1.1 200")
            assert await asyncio.wait_for(reader.readexactly(4), PATIENCE) == b"body"
        writer.close()


def test_a_certificate_that_is_none_is_told(tmp_path: Path) -> None:
    (tmp_path / "c.pem").touch()
    settings = HttpSettings(port=0, tls_certificate=tmp_path / "c.pem", tls_key=tmp_path / "c.pem")

    with pytest.raises(ConfigurationError, match=r"http\.tls_certificate, http\.tls_key: .*c\.pem"):
        HttpServer(YES, settings)


def test_port_in_use_is_one_line_that_says_what_to_do() -> None:
    first = HttpServer(YES, HttpSettings(port=0))
    try:
        with pytest.raises(StartError, match=rf"port {first.port}: Address already in use\. Set http\.port"):
            HttpServer(YES, HttpSettings(port=first.port))
    finally:
        first.close()


def test_an_address_of_another_machine_is_told(tmp_path: Path) -> None:
    settings = HttpSettings(host="192.0.2.1", port=0, reverse_proxy=True, users=tmp_path / "users.toml")

    with pytest.raises(StartError, match=r"192\.0\.2\.1 port 0"):
        HttpServer(YES, settings)


def test_beyond_loopback_it_does_not_listen_unprotected() -> None:
    with pytest.raises(ConfigurationError, match="without TLS"):
        HttpServer(YES, HttpSettings(host="0.0.0.0", port=0))
