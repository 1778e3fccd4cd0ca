from __future__ import annotations

import asyncio
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import httpx
import pytest
import uvloop
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    BestAvailableEncryption,
    Encoding,
    PrivateFormat,
)
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.types import Receive, Scope, Send
from structlog.testing import capture_logs

from nena_shared.certificates import Certificates
from nena_shared.rate_limit import RateLimit
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import StartError
from nena_shared.web import server as server_module
from nena_shared.web.server import HttpServer
from nena_shared.web.settings import HttpSettings
from support.certificates import Authority
from support.waiting import PATIENCE, awaited

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


@pytest.mark.parametrize("loop_factory", [asyncio.new_event_loop, uvloop.new_event_loop])
def test_with_a_certificate_it_speaks_https(
    tmp_path: Path, loop_factory: Callable[[], asyncio.AbstractEventLoop]
) -> None:
    authority = Authority(tmp_path)
    files = authority.sign("server")
    settings = HttpSettings(port=0, tls_certificate=files.certificate, tls_key=files.key)
    trusting = ssl.create_default_context(cafile=authority.ca)

    async def ask() -> None:
        async with (
            serving(settings) as server,
            httpx.AsyncClient(verify=trusting, timeout=PATIENCE) as client,
        ):
            assert server.url.startswith("https://127.0.0.1:")
            answer = await client.get(server.url)
            assert (answer.text, answer.headers["strict-transport-security"]) == ("yes", "max-age=31536000")
            with pytest.raises(httpx.HTTPError):
                await client.get(server.url.replace("https", "http"))

    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(ask())


async def presented(server: HttpServer) -> str:
    """Return the name in the certificate that a new connection sees."""
    trusting = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    _, writer = await asyncio.open_connection("127.0.0.1", server.port, ssl=trusting)
    found = x509.load_der_x509_certificate(writer.get_extra_info("ssl_object").getpeercert(binary_form=True))
    writer.close()
    return found.subject.rfc4514_string()


async def test_a_renewed_certificate_is_used_without_a_restart(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    files, renewed = authority.sign("old"), authority.sign("new", days=2)
    settings = HttpSettings(port=0, tls_certificate=files.certificate, tls_key=files.key)
    certificates = Certificates(http=files.certificate)
    with capture_logs() as logs:
        async with serving(settings) as server:
            before = certificates.validity()
            assert await presented(server) == "CN=old"

            renewed.certificate.replace(files.certificate)  # while the key is still the old one
            assert await presented(server) == "CN=old"
            assert any("renewed certificate not usable" in entry["event"] for entry in logs)
            assert certificates.validity() == before

            renewed.key.replace(files.key)
            assert await presented(server) == "CN=new"
            assert certificates.validity() != before


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


def test_invalid_certificate_is_reported(tmp_path: Path) -> None:
    (tmp_path / "c.pem").touch()
    settings = HttpSettings(port=0, tls_certificate=tmp_path / "c.pem", tls_key=tmp_path / "c.pem")

    with pytest.raises(ConfigurationError, match=r"http\.tls_certificate, http\.tls_key: .*c\.pem"):
        HttpServer(YES, settings)


def test_an_encrypted_key_is_reported_without_asking_for_its_passphrase(tmp_path: Path) -> None:
    key = ec.generate_private_key(ec.SECP256R1()).private_bytes(
        Encoding.PEM, PrivateFormat.PKCS8, BestAvailableEncryption(b"secret")
    )
    (tmp_path / "c.pem").write_bytes(key)
    settings = HttpSettings(port=0, tls_certificate=tmp_path / "c.pem", tls_key=tmp_path / "c.pem")
    with pytest.raises(ConfigurationError, match=r"http\.tls_certificate, http\.tls_key: .*c\.pem"):
        HttpServer(YES, settings)


def test_port_in_use_is_one_line_with_advice() -> None:
    first = HttpServer(YES, HttpSettings(port=0))
    try:
        with pytest.raises(StartError, match=rf"port {first.port}: Address already in use\. Set http\.port"):
            HttpServer(YES, HttpSettings(port=first.port))
    finally:
        first.stop()


def test_address_of_another_machine_is_reported(tmp_path: Path) -> None:
    settings = HttpSettings(host="192.0.2.1", port=0, reverse_proxy=True, users=tmp_path / "users.toml")

    with pytest.raises(StartError, match=r"192\.0\.2\.1 port 0"):
        HttpServer(YES, settings)


def test_unprotected_listening_is_limited_to_loopback() -> None:
    with pytest.raises(ConfigurationError, match="without TLS"):
        HttpServer(YES, HttpSettings(host="0.0.0.0", port=0))


REQUEST = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
GONE = (ConnectionError, asyncio.IncompleteReadError)

Line = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@asynccontextmanager
async def connected(server: HttpServer, source: str = "127.0.0.1") -> AsyncIterator[Line]:
    reader, writer = await asyncio.open_connection("127.0.0.1", server.port, local_addr=(source, 0))
    try:
        yield reader, writer
    finally:
        writer.close()


async def answered(line: Line, request: bytes = REQUEST) -> bool:
    reader, writer = line
    writer.write(request)
    async with asyncio.timeout(PATIENCE):
        try:
            await reader.readuntil(b"\r\n\r\n")
            return await reader.readexactly(3) == b"yes"
        except GONE:
            return False


async def is_closed(line: Line) -> bool:
    async with asyncio.timeout(PATIENCE):
        try:
            return await line[0].read() == b""
        except ConnectionError:
            return True


@pytest.mark.parametrize("begun", [b"", b"GET / HT"])
async def test_idle_connection_is_closed(monkeypatch: pytest.MonkeyPatch, begun: bytes) -> None:
    monkeypatch.setattr(server_module, "HEAD_TIMEOUT", 0.05)
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        line[1].write(begun)
        assert await is_closed(line)


async def test_next_request_has_its_own_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        assert await answered(line)
        monkeypatch.setattr(server_module, "HEAD_TIMEOUT", 0.05)
        assert await answered(line)
        line[1].write(REQUEST[:10])
        assert await is_closed(line)


async def test_an_answered_connection_waits_for_the_next_request(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clients keep connections open for longer than a head may take, and proxies for a minute."""
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        monkeypatch.setattr(server_module, "HEAD_TIMEOUT", 0.05)
        assert await answered(line)
        async with connected(server) as silent:
            assert await is_closed(silent)
        assert await answered(line)


async def test_an_answered_connection_is_closed_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "KEEP_ALIVE", 0.05)
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        assert await answered(line)
        assert await is_closed(line)


async def test_an_answer_may_take_longer_than_the_head(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "HEAD_TIMEOUT", 0.05)
    late = asyncio.Event()

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        asyncio.get_running_loop().call_later(0.2, late.set)
        await late.wait()
        await PlainTextResponse("yes")(scope, receive, send)

    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        server.app = answer
        assert await answered(line)


async def test_connections_per_address_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "PER_ADDRESS", 3)
    monkeypatch.setattr(server_module, "_refusals_logged", RateLimit(rate=1 / 60, burst=1))
    async with serving(HttpSettings(port=0)) as server, AsyncExitStack() as stack:
        told = stack.enter_context(capture_logs())
        lines = [await stack.enter_async_context(connected(server)) for _ in range(3)]
        assert all([await answered(each) for each in lines])
        for _ in range(2):
            assert not await answered(await stack.enter_async_context(connected(server)))
        lines[0][1].close()
        await lines[0][1].wait_closed()
        assert await answered(lines[1])
        assert await answered(await stack.enter_async_context(connected(server)))
    assert [each.get("address") for each in told if "too many" in each["event"]] == ["127.0.0.1"]


async def test_connections_of_a_proxy_are_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "PER_ADDRESS", 1)
    async with (
        serving(HttpSettings(port=0, reverse_proxy=True)) as server,
        AsyncExitStack() as stack,
    ):
        lines = [await stack.enter_async_context(connected(server)) for _ in range(3)]
        assert all([await answered(each) for each in lines])


async def test_http_2_offer_is_answered_without_a_log_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    offer = b"Connection: Upgrade, HTTP2-Settings\r\nUpgrade: %b\r\nHTTP2-Settings: AA\r\n\r\n"
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        for protocol in (b"h2c", b"websocket"):
            assert await answered(line, REQUEST.removesuffix(b"\r\n") + offer % protocol)
    assert caplog.records == []


async def test_endless_body_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "BODY_TIMEOUT", 0.05)
    read = asyncio.Event()

    async def answer(_: Scope, receive: Receive, __: Send) -> None:
        while (await receive())["type"] != "http.disconnect":
            pass
        read.set()

    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        server.app = answer
        line[1].write(b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nbo")
        assert await is_closed(line)
        await asyncio.wait_for(read.wait(), PATIENCE)


async def test_pipelined_body_times_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(server_module, "BODY_TIMEOUT", 0.05)

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] == "GET":
            await send({"type": "http.response.start", "status": 204, "headers": []})
            await send({"type": "http.response.body", "body": b""})
            return
        while (await receive())["type"] != "http.disconnect":
            pass

    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        server.app = answer
        first = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
        line[1].write(first + b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nbo")
        assert (await line[0].readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 204")
        assert await is_closed(line)


def over_tls(folder: Path) -> tuple[HttpSettings, str]:
    """Return settings of a server with TLS, and the file of the authority that vouches for it."""
    authority = Authority(folder)
    files = authority.sign("server")
    return HttpSettings(port=0, tls_certificate=files.certificate, tls_key=files.key), str(authority.ca)


async def test_connection_without_a_handshake_is_closed_and_released(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(server_module, "HANDSHAKE_TIMEOUT", 0.1)
    monkeypatch.setattr(server_module, "PER_ADDRESS", 2)
    settings, ca = over_tls(tmp_path)
    async with serving(settings) as server, AsyncExitStack() as stack:
        for begun in (b"", b"\x16\x03\x01"):
            line = await stack.enter_async_context(connected(server))
            line[1].write(begun)
            assert await is_closed(line)
        line = await stack.enter_async_context(connected(server))
        line[1].write(REQUEST)  # no TLS at all
        assert not await answered(line)
        monkeypatch.setattr(server_module, "HANDSHAKE_TIMEOUT", PATIENCE)  # a busy client needs longer
        async with httpx.AsyncClient(
            verify=ssl.create_default_context(cafile=ca), timeout=PATIENCE
        ) as client:
            assert (await client.get(server.url)).text == "yes"


async def test_silent_connections_of_one_address_do_not_block_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """They count from accepting them on: no handshake has to end for that."""
    monkeypatch.setattr(server_module, "PER_ADDRESS", 3)
    settings, ca = over_tls(tmp_path)
    trusting = ssl.create_default_context(cafile=ca)
    async with serving(settings) as server, AsyncExitStack() as stack:
        held = [await stack.enter_async_context(connected(server, "127.0.0.2")) for _ in range(3)]
        assert await is_closed(await stack.enter_async_context(connected(server, "127.0.0.2")))
        async with httpx.AsyncClient(verify=trusting, timeout=PATIENCE) as client:
            assert (await client.get(server.url)).text == "yes"
        assert not any(line[0].at_eof() for line in held)

        held[0][1].close()

        async def served() -> bool:
            transport = httpx.AsyncHTTPTransport(verify=trusting, local_address="127.0.0.2")
            async with httpx.AsyncClient(transport=transport, timeout=PATIENCE) as client:
                try:
                    return (await client.get(server.url)).text == "yes"
                except httpx.HTTPError:
                    return False

        await awaited(served, bool, what="a connection in the place of a closed one")


async def test_connections_leave_files_for_the_rest_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server_module, "most_connections", lambda: 2)
    async with (
        serving(HttpSettings(port=0, reverse_proxy=True)) as server,
        AsyncExitStack() as stack,
    ):
        lines = [await stack.enter_async_context(connected(server)) for _ in range(3)]
        assert [await answered(each) for each in lines] == [True, True, False]


def test_at_most_half_of_the_files_are_reserved(monkeypatch: pytest.MonkeyPatch) -> None:
    for allowed, expected in ((1024, 896), (100, 50)):
        monkeypatch.setattr("resource.getrlimit", lambda _, allowed=allowed: (allowed, allowed))
        assert server_module.most_connections() == expected


CHUNKED = b"Transfer-Encoding: chunked\r\n"


@pytest.mark.parametrize(
    "request_",
    [
        pytest.param(b"GET / HTTP/1.1\nHost: a\n\n", id="bare line feeds"),
        pytest.param(b"GET / HTTP/1.1\r\nHost: a\nX: y\r\n\r\n", id="one bare line feed"),
        pytest.param(
            b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 4\r\n" + CHUNKED + b"\r\n0\r\n\r\n",
            id="two lengths",
        ),
    ],
)
async def test_ambiguous_request_is_refused(request_: bytes) -> None:
    async with serving(HttpSettings(port=0)) as server:
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        writer.write(request_)
        answer = await asyncio.wait_for(reader.read(), PATIENCE)
        writer.close()

    assert answer.startswith(b"HTTP/1.1 400")
    assert b"yes" not in answer


@pytest.mark.parametrize(
    ("length", "body"),
    [
        pytest.param(b"Content-Length: 4", b"late", id="length"),
        pytest.param(CHUNKED.strip(), b"4\r\nlate\r\n0\r\n\r\n", id="chunks"),
    ],
)
@pytest.mark.parametrize(("end", "status"), [(b"\r\n", b"200"), (b"\n", b"400")])
async def test_a_head_behind_a_late_body_is_checked(
    length: bytes, body: bytes, end: bytes, status: bytes
) -> None:
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        assert await answered(line, b"POST / HTTP/1.1\r\nHost: a\r\n" + length + b"\r\n\r\n")
        line[1].write(body + end.join([b"GET / HTTP/1.1", b"Host: a", b"", b""]))
        async with asyncio.timeout(PATIENCE):
            assert (await line[0].readline()).split()[1] == status


async def test_a_late_body_without_a_next_request_keeps_the_connection() -> None:
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        for _ in range(2):
            assert await answered(line, b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 4\r\n\r\n")
            for part in (b"la", b"te"):
                line[1].write(part)
                await line[1].drain()


async def test_a_malformed_late_body_closes_the_connection() -> None:
    async with serving(HttpSettings(port=0)) as server, connected(server) as line:
        assert await answered(line, b"POST / HTTP/1.1\r\nHost: a\r\n" + CHUNKED + b"\r\n")
        line[1].write(b"no length\r\n")
        assert await is_closed(line)


async def test_a_body_may_hold_line_feeds() -> None:
    async with serving(HttpSettings(port=0)) as server, httpx.AsyncClient(timeout=PATIENCE) as client:
        assert (await client.post(server.url, content=b"a\nb\n\nc")).text == "yes"


@pytest.mark.parametrize(
    ("trusted", "seen"),
    [(["127.0.0.0/8"], "192.0.2.7"), (["198.51.100.0/24"], "127.0.0.1")],
)
async def test_client_address_is_taken_only_from_a_configured_proxy(trusted: list[str], seen: str) -> None:
    async def who(scope: Scope, receive: Receive, send: Send) -> None:
        await PlainTextResponse(scope["client"][0])(scope, receive, send)

    settings = HttpSettings.model_validate({"port": 0, "reverse_proxy": True, "trusted_proxies": trusted})
    async with serving(settings) as server, httpx.AsyncClient(timeout=PATIENCE) as client:
        server.app = who
        assert (await client.get(server.url, headers={"x-forwarded-for": "192.0.2.7"})).text == seen


async def test_https_works_behind_a_proxy(tmp_path: Path) -> None:
    """As in Kubernetes: the ingress reaches it by TLS, and says who asks."""

    async def who(scope: Scope, receive: Receive, send: Send) -> None:
        await PlainTextResponse(f"{scope['client'][0]} by {scope['scheme']}")(scope, receive, send)

    authority = Authority(tmp_path)
    files = authority.sign("server")
    settings = HttpSettings(port=0, tls_certificate=files.certificate, tls_key=files.key, reverse_proxy=True)
    trusting = ssl.create_default_context(cafile=authority.ca)
    async with serving(settings) as server, httpx.AsyncClient(verify=trusting, timeout=PATIENCE) as client:
        server.app = who
        forwarded = {"x-forwarded-for": "192.0.2.7", "x-forwarded-proto": "https"}
        assert (await client.get(server.url, headers=forwarded)).text == "192.0.2.7 by https"
        with pytest.raises(httpx.HTTPError):
            await client.get(server.url.replace("https", "http"))
