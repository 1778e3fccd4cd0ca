from __future__ import annotations

import sys
import time
from collections.abc import AsyncIterator
from datetime import datetime, timedelta
from pathlib import Path

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from structlog.testing import capture_logs

from nena_shared.clock import SystemClock
from nena_shared.extensions.oidc.issuer import LOOKS_AT_ONCE, IssuerTokens
from nena_shared.fleet_api.base import Role
from nena_shared.settings import ConfigurationError
from nena_shared.web.access import (
    COOKIE,
    WRONG_TOKENS_AT_ONCE,
    AccessControl,
    access_tokens_of,
    protect,
)
from nena_shared.web.settings import HttpSettings, OidcSettings
from nena_shared.web.users import User, UsersFile, hash_of, write_users
from support.clocks import ManualClock
from support.oidc_issuer import AUDIENCE, DISCOVERY, LIFE, OidcIssuer, ec_key

REQUESTS = 30
LEEWAY = OidcSettings.model_fields["leeway"].default


def rule(method: str, path: str) -> Role | None:
    """Return the rule: viewers read, operators change, and all clients see the health."""
    if path == "/healthz":
        return None
    return Role.VIEWER if method in ("GET", "HEAD", "OPTIONS") else Role.OPERATOR


async def who(request: Request) -> Response:
    user = request.state.user
    return JSONResponse(user.name if user else None)


class Door:
    """An application behind access control, as clients meet it."""

    def __init__(
        self, folder: Path, *, login: bool = True, cookies: bool = False, address: str = "127.0.0.1"
    ) -> None:
        self.file = folder / "users.toml"
        self.clock = ManualClock()
        write_users(
            self.file,
            [User(name=role.name.lower(), role=role, token_sha256=hash_of(role.name)) for role in Role],
        )
        settings = HttpSettings(port=0, requests_per_second=1, burst=REQUESTS)
        users = UsersFile(self.file) if login else None
        app = Starlette(routes=[Route("/{path:path}", who, methods=["GET", "POST", "DELETE"])])
        guard = AccessControl(app, settings, rule, users, self.clock, cookies)
        self.client = httpx.AsyncClient(
            transport=httpx.ASGITransport(guard, client=(address, 123)), base_url="http://door"
        )

    async def ask(
        self, method: str, path: str = "/orders", token: str = "", **headers: str
    ) -> httpx.Response:
        if token:
            headers["authorization"] = f"Bearer {token}"
        return await self.client.request(method, path, headers=headers)


@pytest.fixture
def door(tmp_path: Path) -> Door:
    return Door(tmp_path)


@pytest.mark.parametrize(
    ("role", "method", "status"),
    [
        ("VIEWER", "GET", 200),
        ("VIEWER", "POST", 403),
        ("VIEWER", "DELETE", 403),
        ("OPERATOR", "GET", 200),
        ("OPERATOR", "POST", 200),
        ("ADMIN", "POST", 200),
    ],
)
async def test_each_role_has_its_permissions(door: Door, role: str, method: str, status: int) -> None:
    answer = await door.ask(method, token=role)

    assert answer.status_code == status
    if status == 200:
        assert answer.json() == role.lower()
    else:
        assert answer.headers["content-type"] == "application/problem+json"
        assert (
            answer.json()["detail"] == f"{role.lower()} is {role.lower()}; this requires the role operator."
        )


@pytest.mark.parametrize(
    "header", ["", "Bearer wrong", "Bearer ", "Basic VIEWER", "VIEWER", "Bearer VIEWER x"]
)
async def test_missing_or_unknown_token_is_401(door: Door, header: str) -> None:
    answer = await door.ask("GET", **({"authorization": header} if header else {}))

    assert answer.status_code == 401
    assert answer.headers["www-authenticate"].startswith("Bearer")
    assert "Authorization: Bearer" in answer.json()["detail"]


async def test_unknown_token_is_distinguished_from_a_missing_one(door: Door) -> None:
    wrong = (await door.ask("GET", authorization="Bearer wrong")).json()["detail"]

    assert wrong == "Unknown token. " + (await door.ask("GET")).json()["detail"]


async def test_public_paths_need_no_token(door: Door) -> None:
    assert (await door.ask("GET", "/healthz")).status_code == 200
    assert (await door.ask("GET", "/healthz/more")).status_code == 401


async def test_cookies_are_accepted_only_with_origin_checks(door: Door) -> None:
    assert (await door.ask("GET", cookie=f"{COOKIE}=VIEWER")).status_code == 401


async def test_browser_sends_its_token_as_a_cookie(tmp_path: Path) -> None:
    door = Door(tmp_path, cookies=True)
    assert (await door.ask("GET", cookie=f"a=b; {COOKIE}=VIEWER")).json() == "viewer"
    assert (await door.ask("POST", cookie=f"{COOKIE}=VIEWER")).status_code == 403
    assert (await door.ask("GET", cookie=f"{COOKIE}=wrong")).status_code == 401
    assert (await door.ask("GET", cookie="{}=;;\x7f")).status_code == 401


async def test_without_a_users_file_everything_is_allowed(tmp_path: Path) -> None:
    door = Door(tmp_path, login=False)

    assert (await door.ask("POST")).json() is None
    assert (await door.ask("POST", token="anything")).json() is None


async def test_too_many_requests_are_delayed(door: Door) -> None:
    for _ in range(REQUESTS):
        assert (await door.ask("GET", token="VIEWER")).status_code == 200
    answer = await door.ask("GET", token="VIEWER")
    assert (answer.status_code, answer.headers["retry-after"]) == (429, "1")
    assert (await door.ask("GET", token="ADMIN")).status_code == 200, "each has a limit of its own"
    door.clock.advance(1.0)

    assert (await door.ask("GET", token="VIEWER")).status_code == 200


async def test_address_named_like_a_user_has_its_own_limit(tmp_path: Path) -> None:
    """Simulate a misconfigured proxy that passes on the addresses claimed by clients."""
    door = Door(tmp_path, address="user viewer")
    statuses = [(await door.ask("GET", "/healthz")).status_code for _ in range(REQUESTS + 1)]
    assert statuses[-1] == 429
    assert (await door.ask("GET", token="VIEWER")).status_code == 200


async def test_tokens_cannot_be_guessed(door: Door) -> None:
    for number in range(WRONG_TOKENS_AT_ONCE):
        assert (await door.ask("GET", token=f"guess {number}")).status_code == 401
    assert (await door.ask("GET", token="guess")).status_code == 429
    assert (await door.ask("GET", token="VIEWER")).status_code == 200, "others come from there, too"
    door.clock.advance(5.0)

    assert (await door.ask("GET", token="guess")).status_code == 401


async def test_broken_users_file_denies_access(door: Door) -> None:
    door.file.write_text("[[user")

    answer = await door.ask("GET", token="ADMIN")
    assert answer.status_code == 503
    assert str(door.file) not in answer.text
    assert (await door.ask("GET", "/healthz")).status_code == 200


def guarded(issuer: OidcIssuer, users: Path | None = None) -> httpx.AsyncClient:
    app = Starlette(routes=[Route("/{path:path}", who, methods=["GET", "POST"])])
    oidc = OidcSettings(issuer=issuer.address, audience=AUDIENCE)
    access = protect(app, HttpSettings(port=0, users=users, oidc=oidc), rule)
    return httpx.AsyncClient(transport=httpx.ASGITransport(access), base_url="http://door")


def showing(token: str) -> dict[str, str]:
    return {"authorization": f"Bearer {token}"}


async def test_issuer_tokens_are_accepted_in_addition_to_own_ones(door: Door, issuer: OidcIssuer) -> None:
    async with guarded(issuer, door.file) as client:
        assert (await client.post("/orders", headers=showing(issuer.token("ann")))).json() == "ann"
        assert (await client.get("/orders", headers=showing(issuer.token("vic")))).json() == "vic"
        assert (await client.post("/orders", headers=showing("OPERATOR"))).json() == "operator"

        refused = await client.post("/orders", headers=showing(issuer.token("vic")))
        assert (refused.status_code, refused.json()["detail"]) == (
            403,
            "vic is viewer; this requires the role operator.",
        )


async def test_issuer_alone_requires_login(issuer: OidcIssuer) -> None:
    async with guarded(issuer) as client:
        for headers in ({}, showing("VIEWER")):
            assert (await client.get("/orders", headers=headers)).status_code == 401
        assert (await client.get("/healthz")).status_code == 200
        assert (await client.get("/orders", headers=showing(issuer.token("vic")))).status_code == 200


async def test_invalid_token_is_401_with_a_reason(issuer: OidcIssuer) -> None:
    async with guarded(issuer) as client:
        answer = await client.get("/orders", headers=showing(issuer.token("ann", exp=1)))

    assert answer.status_code == 401
    assert answer.json()["detail"] == "The token is not accepted: it has expired. Sign in again."
    assert answer.headers["www-authenticate"] == 'Bearer realm="NeNa", error="invalid_token"'


async def test_user_without_a_role_gets_403_with_advice(issuer: OidcIssuer) -> None:
    async with guarded(issuer) as client:
        answer = await client.get("/orders", headers=showing(issuer.token("bob")))

    assert answer.status_code == 403
    assert "Ask the administrator of the issuer" in answer.json()["detail"]


async def test_unavailable_issuer_does_not_affect_own_tokens(door: Door, issuer: OidcIssuer) -> None:
    issuer.broken[DISCOVERY] = b"gone"
    async with guarded(issuer, door.file) as client:
        answer = await client.get("/orders", headers=showing(issuer.token("ann")))
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "10")
        assert "issuer is unavailable" in answer.json()["detail"]
        assert (await client.post("/orders", headers=showing("OPERATOR"))).status_code == 200
        assert (await client.get("/orders", headers=showing("wrong"))).status_code == 401

        issuer.broken.clear()
        assert (await client.post("/orders", headers=showing(issuer.token("ann")))).status_code == 200


async def test_invalid_issuer_tokens_are_rate_limited(issuer: OidcIssuer) -> None:
    async with guarded(issuer) as client:
        for _ in range(WRONG_TOKENS_AT_ONCE):
            assert (await client.get("/orders", headers=showing("made.up.token"))).status_code == 401
        assert (await client.get("/orders", headers=showing("made.up.token"))).status_code == 429
        assert (await client.get("/orders", headers=showing(issuer.token("ann")))).status_code == 200


class LaterClock(SystemClock):
    """Runs ``ahead`` of the machine's."""

    ahead = timedelta()

    def monotonic(self) -> float:
        return super().monotonic() + self.ahead.total_seconds()

    def now(self) -> datetime:
        return super().now() + self.ahead


def telling(issuer: OidcIssuer, clock: LaterClock, *seconds: float) -> httpx.AsyncClient:
    """Return a client of an answer with a part at each of these ``seconds``."""

    async def lasting(_: Request) -> Response:
        async def parts() -> AsyncIterator[bytes]:
            for each in seconds:
                clock.ahead = timedelta(seconds=each)
                yield f"{each:g} ".encode()

        return StreamingResponse(parts())

    settings = HttpSettings(port=0, oidc=OidcSettings(issuer=issuer.address, audience=AUDIENCE))
    app = Starlette(routes=[Route("/events", lasting)])
    access = AccessControl(app, settings, rule, None, clock, oidc=access_tokens_of(settings))
    return httpx.AsyncClient(transport=httpx.ASGITransport(access), base_url="http://door")


async def test_stream_ends_when_its_token_expires(issuer: OidcIssuer) -> None:
    async with telling(issuer, LaterClock(), 0, 2, LIFE + LEEWAY) as client:
        answer = await client.get("/events", headers=showing(issuer.token("vic")))

    assert answer.text == "0 2 "


async def test_token_within_the_leeway_gets_complete_responses(issuer: OidcIssuer) -> None:
    over = issuer.token("vic", exp=int(time.time()) - 1)
    async with telling(issuer, LaterClock(), 0, 2) as client:
        answer = await client.get("/events", headers=showing(over))

    assert (answer.status_code, answer.text) == (200, "0 2 ")


async def test_users_without_a_role_are_rate_limited(issuer: OidcIssuer) -> None:
    bob = showing(issuer.token("bob"))
    with capture_logs() as logged:
        async with guarded(issuer) as client:
            for _ in range(WRONG_TOKENS_AT_ONCE):
                assert (await client.get("/orders", headers=bob)).status_code == 403
            assert (await client.get("/orders", headers=bob)).status_code == 429
            assert (await client.get("/orders", headers=showing(issuer.token("vic")))).status_code == 200
    assert [each["event"] for each in logged].count("user without a role") == WRONG_TOKENS_AT_ONCE


async def test_unchecked_tokens_are_rate_limited(issuer: OidcIssuer) -> None:
    issuer.broken[DISCOVERY] = b"gone"
    with capture_logs() as logged:
        async with guarded(issuer) as client:
            for _ in range(WRONG_TOKENS_AT_ONCE):
                assert (await client.get("/orders", headers=showing(issuer.token()))).status_code == 503
            assert (await client.get("/orders", headers=showing(issuer.token()))).status_code == 429
    assert [each["event"] for each in logged].count("token could not be checked") == WRONG_TOKENS_AT_ONCE


async def test_key_beyond_the_request_limit_does_not_reject_the_token(issuer: OidcIssuer) -> None:
    async with guarded(issuer) as client:
        for number in range(LOOKS_AT_ONCE):
            made_up = issuer.token(key=ec_key(f"made-up-{number}"))
            assert (await client.get("/orders", headers=showing(made_up))).status_code == 401
        issuer.keys = [ec_key("next")]
        answer = await client.get("/orders", headers=showing(issuer.token()))

    assert (answer.status_code, answer.headers["retry-after"]) == (503, "10")


OIDC = OidcSettings(issuer="https://login.example", audience="nena")


def test_it_is_off_until_an_issuer_is_named() -> None:
    assert access_tokens_of(HttpSettings(port=0)) is None
    assert isinstance(access_tokens_of(HttpSettings(port=0, oidc=OIDC)), IssuerTokens)


def test_missing_libraries_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [each for each in sys.modules if each.startswith("nena_shared.extensions.oidc.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "jwt", None)

    with pytest.raises(ConfigurationError, match=r"http\.oidc\.issuer: .*jwt.*\[oidc\]"):
        access_tokens_of(HttpSettings(port=0, oidc=OIDC))
