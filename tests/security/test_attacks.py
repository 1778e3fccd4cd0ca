"""Attacks on the services of a TLS site: each attempt is refused, and work continues."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import ssl
import time
import warnings
from contextlib import ExitStack

import httpx
import pytest

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.fleet_api.base import Role
from nena_shared.mqtt import Outbound
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for
from security.conftest import FILES, MESSAGES_BURST, OPEN, SERVICES, TlsSite
from support.running_site import ROBOT_1, ROBOT_2
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(600)]

ORDER = {"destinations": [{"locationName": "Storage", "operation": "NOP"}]}
ORDERS = "/v1/transportOrders"
MOST_SECONDS = 20.0
"""That a refusal takes, on however slow a machine; the attacks take minutes where they succeed."""
MORE_MB = 150.0
SECRET = re.compile(rb"root:.*:0:0:|PRIVATE KEY|token_sha256")
ATTACKER = "127.0.0.66"
"""Another address of this machine: limits count by address."""


def filled(path: str) -> str:
    return re.sub(r"\{\w+\}", "x", path)


@pytest.mark.parametrize("service", SERVICES)
async def test_requests_without_a_token_are_rejected(site: TlsSite, service: str) -> None:
    routes = [each for each in await site.routes(service) if each.path not in OPEN]
    assert len(routes) > 8
    async with site.client(service) as nobody:
        for each in routes:
            answer = await nobody.request(each.method, filled(each.path))
            public = each.path.startswith("/api/v1/session")
            assert answer.status_code == 401 or public, (each, answer.status_code)
            assert not SECRET.search(answer.content)


@pytest.mark.parametrize("service", SERVICES)
async def test_viewer_cannot_change_anything(site: TlsSite, service: str) -> None:
    routes = [each for each in await site.routes(service) if each.method not in ("GET", "HEAD")]
    assert routes
    async with site.client(service, Role.VIEWER) as viewer:
        for each in routes:
            answer = await viewer.request(each.method, filled(each.path), json={})
            own = each.path.startswith("/api/v1/session")
            assert answer.status_code == 403 or own, (each, answer.status_code, answer.text)


async def test_operator_cannot_administrate(site: TlsSite) -> None:
    async with site.client("order-service", Role.OPERATOR) as operator:
        for path in ("/v1/plantModel", "/v1/zoneSets/x"):
            assert (await operator.put(path, json={})).status_code == 403


@pytest.mark.parametrize("service", SERVICES)
async def test_connections_without_tls_are_rejected(site: TlsSite, service: str) -> None:
    plain = site.url(service).replace("https", "http")
    async with httpx.AsyncClient(timeout=MOST_SECONDS) as client:
        with pytest.raises(httpx.TransportError):
            await client.get(f"{plain}/healthz")
    old = ssl.create_default_context(cafile=None)
    old.check_hostname, old.verify_mode = False, ssl.CERT_NONE
    old.minimum_version = ssl.TLSVersion.MINIMUM_SUPPORTED
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):
        old.maximum_version = ssl.TLSVersion.TLSv1_1
    with pytest.raises(OSError, match=r"(?i)ssl|protocol|reset"):
        await asyncio.open_connection("127.0.0.1", site.ports[service], ssl=old)


@pytest.mark.parametrize("service", SERVICES)
async def test_browsers_receive_hsts_and_a_content_policy(site: TlsSite, service: str) -> None:
    async with site.client(service, Role.VIEWER) as client:
        answer = await client.get("/")
    assert "max-age" in answer.headers["strict-transport-security"]
    if service == "status-aggregator":
        assert answer.headers["x-content-type-options"] == "nosniff"
        policy = answer.headers["content-security-policy"]
        assert "default-src 'none'" in policy or "default-src 'self'" in policy
        assert "unsafe-inline" not in policy.partition("script-src")[2].partition(";")[0]
        assert "unsafe-eval" not in policy


PATHS = (
    "/../../../../etc/passwd",
    "/..%2f..%2f..%2f..%2fetc%2fpasswd",
    "/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
    "/static/../../../../../etc/passwd",
    "/static/..%2f..%2f..%2f..%2f..%2fetc%2fpasswd",
    "/static//etc/passwd",
    "/static/%00/etc/passwd",
    "/static/..\\\\..\\\\..\\\\etc\\\\passwd",
    "/v1/transportOrders/..%2f..%2f..%2fetc%2fpasswd",
    "/api/v1/robots/..%2f../..%2f../map",
    "/api/v1/recordings/..%2f../..%2f../passwd",
    "//etc/passwd",
    "/users.toml",
    "/static/../users.toml",
)


@pytest.mark.parametrize("service", SERVICES)
async def test_paths_cannot_reach_local_files(site: TlsSite, service: str) -> None:
    for path in PATHS:
        head = (
            f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n"
            "Authorization: Bearer VIEWER\r\nConnection: close\r\n\r\n"
        )
        answer = await site.say(service, head.encode())
        assert re.match(rb"HTTP/1.1 (3|4)\d\d ", answer), (path, answer[:200])
        assert not SECRET.search(answer), path


TEXTS = (
    "'; DROP TABLE orders; --",
    '" OR 1=1 --',
    "<script>alert(1)</script>",
    "<img src=x onerror=alert(1)>",
    "x\r\nSet-Cookie: session=1",
    "../../etc/passwd",
    "${jndi:ldap://127.0.0.1/x}",
    "{{7*7}}",
    "%s%n%x",
    "nena/v1/#",
    "a\0b",
    "\u202e\ufeff\ud7ff",
)
"""Of SQL, HTML, headers, paths, templates, formats and topics."""


async def test_texts_are_never_interpreted_as_code(site: TlsSite) -> None:
    """A name is refused, free text is kept unchanged, and lookups find nothing or are refused."""
    async with site.client("order-service", Role.OPERATOR) as operator:
        before = len((await operator.get(ORDERS)).json()["transportOrders"])
        for text in TEXTS:
            named = await operator.post(ORDERS, json={**ORDER, "name": text})
            assert named.status_code in (400, 422), (text, named.text)
            for asked in (
                await operator.get(ORDERS, params={"intendedVehicle": text}),
                await operator.get(ORDERS, params={"after": text, "state": text}),
                await operator.get(f"{ORDERS}/{httpx.QueryParams({'x': text})}"),
            ):
                assert asked.status_code in (200, 400, 404, 422), (text, asked.status_code)
                assert asked.headers["content-type"].partition(";")[0].endswith("json")
                assert "set-cookie" not in asked.headers
        free = "<script>alert('1')</script>' OR 1=1 --"
        made = await operator.post(
            ORDERS, json={**ORDER, "name": "T-text", "properties": [{"key": "note", "value": free}]}
        )
        assert made.status_code == 201, made.text
        assert made.json()["properties"] == [{"key": "note", "value": free}]
        assert len((await operator.get(ORDERS)).json()["transportOrders"]) == before + 1


NESTED = b"[" * 200_000
BOMBS = {
    "nested JSON": ("POST", ORDERS, "application/json", NESTED + b"]" * 200_000),
    "nested JSON without an end": ("POST", ORDERS, "application/json", b'{"a":' * 200_000),
    "huge number": ("POST", ORDERS, "application/json", b'{"priority": ' + b"9" * 500_000 + b"}"),
    "huge exponent": ("POST", ORDERS, "application/json", b'{"priority": 1e999999999}'),
    "very many keys": (
        "POST",
        ORDERS,
        "application/json",
        json.dumps({str(n): 0 for n in range(100_000)}).encode(),
    ),
    "huge body": ("POST", ORDERS, "application/json", b" " * 40_000_000),
    "one field of many destinations": (
        "POST",
        ORDERS,
        "application/json",
        json.dumps({"destinations": ORDER["destinations"] * 20_000}).encode(),
    ),
}


@pytest.mark.parametrize("bomb", BOMBS)
async def test_decompression_bomb_is_refused_at_once(site: TlsSite, bomb: str) -> None:
    method, path, kind, body = BOMBS[bomb]
    program = site.programs["order-service"]
    megabytes, begun = program.memory_mb, time.monotonic()
    async with site.client("order-service", Role.OPERATOR) as operator:
        try:
            answer = await operator.request(method, path, content=body, headers={"content-type": kind})
        except httpx.TransportError:
            answer = None  # the connection was closed while the body was sent
    assert answer is None or 400 <= answer.status_code < 500, answer.text
    assert time.monotonic() - begun < MOST_SECONDS
    assert program.memory_mb < megabytes + MORE_MB


XML = {
    "billion laughs": b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(
        f'<!ENTITY {b} "{f"&{a};" * 10}">'.encode() for a, b in zip("abcdefgh", "bcdefghi", strict=True)
    )
    + b"]><model>&i;</model>",
    "external entity": b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]><model name="&a;">&a;</model>',
    "external DTD": b'<!DOCTYPE x SYSTEM "http://127.0.0.1:1/x.dtd"><model/>',
    "nested": b"<model>" * 500_000,
}


@pytest.mark.parametrize("bomb", XML)
async def test_xml_bomb_of_an_administrator_is_refused_at_once(site: TlsSite, bomb: str) -> None:
    program = site.programs["order-service"]
    megabytes, begun = program.memory_mb, time.monotonic()
    async with site.client("order-service", Role.ADMIN) as admin:
        for kind in ("application/xml", "application/json"):
            answer = await admin.put("/v1/plantModel", content=XML[bomb], headers={"content-type": kind})
            assert 400 <= answer.status_code < 500, answer.text
            assert not SECRET.search(answer.content)
    assert time.monotonic() - begun < MOST_SECONDS
    assert program.memory_mb < megabytes + MORE_MB


@pytest.mark.parametrize("service", SERVICES)
async def test_silent_connections_do_not_block_others(site: TlsSite, service: str) -> None:
    with ExitStack() as stack:
        for _ in range(FILES + 100):
            stack.enter_context(
                socket.create_connection(("127.0.0.1", site.ports[service]), source_address=(ATTACKER, 0))
            )
        async with site.client(service, Role.VIEWER) as viewer:
            begun = time.monotonic()
            assert (await viewer.get("/readyz")).status_code < 600
            assert time.monotonic() - begun < MOST_SECONDS


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize(
    "head",
    [
        (
            "POST /healthz HTTP/1.1\r\nHost: a\r\nContent-Length: 4\r\n"
            "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
        ),
        "GET /healthz HTTP/1.1\nHost: a\n\n",
        "GET /healthz HTTP/1.1\r\nHost: a\r\nContent-Length: 4\r\nContent-Length: 5\r\n\r\nabcde",
        "GET /healthz HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: xchunked\r\n\r\n",
        "GET /healthz HTTP/1.1\r\nHost : a\r\n\r\n",
        "GET /healthz HTTP/1.1\r\n Host: a\r\n\r\n",
    ],
    ids=["CL and TE", "line feeds", "two lengths", "unknown coding", "space before colon", "folded"],
)
async def test_ambiguous_request_is_refused(site: TlsSite, service: str, head: str) -> None:
    answer = await site.say(service, head.encode())
    assert re.match(rb"HTTP/1.1 (400|401|501) ", answer), answer[:300]
    assert answer.count(b"HTTP/1.1 ") == 1


async def test_forged_forwarding_headers_are_ignored(site: TlsSite) -> None:
    """Wrong tokens are counted by the address that they come from, whatever X-Forwarded-For claims."""
    statuses = set()
    for number in range(60):
        head = (
            f"GET {ORDERS} HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer wrong-{number}\r\n"
            f"X-Forwarded-For: 192.0.2.{number}\r\nConnection: close\r\n\r\n"
        )
        answer = await site.say("order-service", head.encode(), source=ATTACKER)
        statuses.add(answer.split(b" ", 2)[1])
    assert statuses == {b"401", b"429"}


MARKUP = re.compile(
    r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment|\beval\(|new Function"
)
IMPORT = re.compile(r'(?:from|import) "(\.[^"]+)"')


async def test_panel_does_not_render_text_as_markup(site: TlsSite) -> None:
    """Names and texts of others become nodes of text: no script of the panel parses HTML or code."""
    async with site.client("status-aggregator") as browser:
        page = (await browser.get("/")).text
        found, waiting = set(), re.findall(r'src="([^"]+\.js)"', page)
        assert waiting
        while waiting:
            path = waiting.pop()
            script = (await browser.get(path)).raise_for_status().text
            assert not MARKUP.search(script), path
            found.add(path)
            near = [str(httpx.URL(path).join(each)) for each in IMPORT.findall(script)]
            waiting += [each for each in near if each not in found]
    assert len(found) > 20


@pytest.mark.parametrize(
    "headers",
    [
        {"origin": "https://evil.example"},
        {"origin": "null"},
        {"sec-fetch-site": "cross-site"},
        {"origin": "https://127.0.0.1:1", "sec-fetch-site": "same-site"},
        {"host": "evil.example", "origin": "https://evil.example", "sec-fetch-site": "same-origin"},
    ],
)
async def test_pages_of_other_sites_cannot_send_commands(site: TlsSite, headers: dict[str, str]) -> None:
    """Its browser has a session; what another page sends with it is refused."""
    async with site.client("status-aggregator") as browser:
        session = await browser.post("/api/v1/session", headers={"authorization": "Bearer OPERATOR"})
        assert session.status_code == 200, session.text
        cookie = session.headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "secure" in cookie
        assert "samesite=strict" in cookie
        for kind in ("application/json", "text/plain"):
            answer = await browser.post(
                "/api/v1/control/transportOrders",
                content=json.dumps({**ORDER, "name": "T-of-another-page"}),
                headers={**headers, "content-type": kind},
            )
            assert answer.status_code == 403, (answer.status_code, answer.text)
    async with site.client("order-service", Role.VIEWER) as viewer:
        assert (await viewer.get(f"{ORDERS}/T-of-another-page")).status_code == 404


async def test_own_page_can_send_commands(site: TlsSite) -> None:
    """What the tests above are refused is refused for the page that it comes from."""
    async with site.client("status-aggregator") as browser:
        await browser.post("/api/v1/session", headers={"authorization": "Bearer OPERATOR"})
        headers = {"origin": site.url("status-aggregator"), "sec-fetch-site": "same-origin"}
        order = {**ORDER, "name": "T-of-the-page"}
        answer = await browser.post("/api/v1/control/transportOrders", json=order, headers=headers)
        assert answer.status_code == 201, answer.text


FLOOD = 20 * MESSAGES_BURST
FLOODED_ROBOT, ITS_NEIGHBOUR = RobotKey("ACME", "1"), RobotKey("ACME", "2")


async def test_a_flood_of_a_robots_states_is_dropped_and_counted(site: TlsSite) -> None:
    """Mosquitto lets it through; the services drop what is beyond their limit, and read the neighbour."""
    topic, codec, robot = "uagv/v2/{}/state", codec_for("2.1.0"), HonestRobot(key=FLOODED_ROBOT)
    async with site.mqtt.client(ROBOT_1) as flood, site.mqtt.client(ROBOT_2) as neighbour:
        for _ in range(FLOOD // 100):
            for _ in range(100):
                message = codec.encode(robot.state())
                flood.link.publish(Outbound(topic.format(FLOODED_ROBOT), message, qos=1))
            assert await flood.link.drain(PATIENCE)
        alone = HonestRobot(key=ITS_NEIGHBOUR)
        neighbour.link.publish(
            Outbound(topic.format(ITS_NEIGHBOUR), codec.encode(alone.state()), qos=1, retain=True)
        )
        assert await neighbour.link.drain(PATIENCE)
        async with site.client("status-aggregator", Role.VIEWER) as viewer:

            async def known() -> set[str]:
                robots = (await viewer.get("/api/v1/fleet")).raise_for_status().json()["robots"]
                return {each["serialNumber"] for each in robots}

            await awaited(known, lambda found: "2" in found, what="the neighbour's state is read", every=0.2)
        dropped = {
            "order-service": 'nena_order_service_messages_ignored_total{reason="rate"}',
            "status-aggregator": 'nena_messages_ignored_total{reason="rate",topic="state"}',
        }
        for service, sign in dropped.items():
            async with site.client(service, Role.VIEWER) as viewer:
                metrics = (await viewer.get("/metrics")).raise_for_status().text
            (count,) = re.findall(rf"^{re.escape(sign)} (\S+)$", metrics, re.MULTILINE)
            assert float(count) > 0, service
