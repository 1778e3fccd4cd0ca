from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest

from nena_shared.fleet_api.base import Role
from nena_shared.web.access import COOKIE, WRONG_TOKENS_AT_ONCE
from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import User, hash_of, write_users
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.api.session import make_rule
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings, HistorySettings
from support.clocks import ManualClock
from support.fleet_examples import START

SESSION = "/api/v1/session"
FLEET = "/api/v1/fleet"
ANN = {"authorization": "Bearer ann's"}


def client_of(users: Path | None, scheme: str = "http") -> httpx.AsyncClient:
    settings = AggregatorSettings(
        history=HistorySettings(url=None), http=AggregatorHttpSettings(port=0, users=users)
    )
    app = make_app(Aggregator(settings, ManualClock(start=START)), settings.http)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=f"{scheme}://127.0.0.1:8080")


@pytest.fixture
def users(tmp_path: Path) -> Path:
    ann = User(name="ann", role=Role.OPERATOR, token_sha256=hash_of("ann's"))
    write_users(tmp_path / "users.toml", [ann])
    return tmp_path / "users.toml"


@pytest.fixture
async def client(users: Path) -> AsyncIterator[httpx.AsyncClient]:
    async with client_of(users) as made:
        yield made


async def test_a_browser_logs_in_once_and_out_again(client: httpx.AsyncClient) -> None:
    for path in (SESSION, FLEET):
        assert (await client.get(path)).status_code == 401

    assert (await client.post(SESSION, headers=ANN)).json() == {"user": "ann", "role": "operator"}
    assert (await client.get(FLEET)).status_code == 200
    assert (await client.get(SESSION)).json()["user"] == "ann"

    assert (await client.delete(SESSION)).status_code == 204
    for path in (SESSION, FLEET):
        assert (await client.get(path)).status_code == 401


async def test_unknown_token_sets_no_cookie(client: httpx.AsyncClient) -> None:
    answer = await client.post(SESSION, headers={"authorization": "Bearer bob's"})

    assert answer.status_code == 401
    assert COOKIE not in client.cookies


@pytest.mark.parametrize(("scheme", "secure"), [("http", False), ("https", True)])
async def test_scripts_and_other_sites_do_not_get_the_cookie(
    users: Path, scheme: str, *, secure: bool
) -> None:
    async with client_of(users, scheme) as client:
        cookie = (await client.post(SESSION, headers=ANN)).headers["set-cookie"]

    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert ("Secure" in cookie) == secure
    assert "Max-Age" not in cookie, "it ends with the browser"


async def test_removed_user_is_locked_out_immediately(client: httpx.AsyncClient, users: Path) -> None:
    await client.post(SESSION, headers=ANN)
    write_users(users, [])

    assert (await client.get(FLEET)).status_code == 401
    assert (await client.get(SESSION)).status_code == 401


async def test_the_pages_own_files_come_with_an_old_cookie_too(
    client: httpx.AsyncClient, users: Path
) -> None:
    """All of them: an old token does not count as tried again with each file."""
    await client.post(SESSION, headers=ANN)
    write_users(users, [])

    for _ in range(2 * WRONG_TOKENS_AT_ONCE):
        assert (await client.get("/login.html")).status_code == 200


async def test_refusals_have_the_headers_of_security(client: httpx.AsyncClient) -> None:
    refused = await client.get(FLEET)

    assert refused.status_code == 401
    assert refused.headers["content-security-policy"].startswith("default-src 'none'")


async def test_without_users_no_login_is_required() -> None:
    async with client_of(None) as client:
        assert (await client.get(SESSION)).json() == {"user": None, "role": None}
        assert (await client.get(FLEET)).status_code == 200


RULE = make_rule(HttpSettings(port=0))


@pytest.mark.parametrize(
    ("request_line", "role"),
    [
        ("GET /", None),
        ("GET /login.html", None),
        ("GET /texts/en.js", None),
        ("GET /reasons/en.json", None),
        ("GET /healthz", None),
        ("GET /readyz", None),
        ("GET /metrics", Role.VIEWER),
        ("GET /api/v1/fleet", Role.VIEWER),
        ("HEAD /api/v1/fleet", Role.VIEWER),
        ("GET /api/v1/events", Role.VIEWER),
        ("GET /api/v1/recordings", Role.VIEWER),
        ("GET /api/v1/recordings/ACME/r1/a.mcap", Role.VIEWER),
        ("GET /api/v1/recordings/nena/order-service/a.mcap", Role.ADMIN),
        ("GET /api/v1/control/vehicles", Role.VIEWER),
        ("POST /api/v1/control/transportOrders", Role.OPERATOR),
        ("DELETE /api/v1/control/transportOrders", Role.OPERATOR),
        ("GET /api/v1/session", Role.VIEWER),
        ("POST /api/v1/session", Role.VIEWER),
        ("DELETE /api/v1/session", None),
        ("POST /api/v1/session/", Role.OPERATOR),
        ("GET /api/v1/session/oidc", None),
        ("GET /api/v1/session/oidc/callback", None),
        ("GET /api/v1/session/oidcs", Role.VIEWER),
    ],
)
def test_required_role_of_requests(request_line: str, role: Role | None) -> None:
    assert RULE(*request_line.split()) == role


def test_metrics_are_open_where_the_settings_say_so() -> None:
    assert make_rule(HttpSettings(port=0, open_metrics=True))("GET", "/metrics") is None
