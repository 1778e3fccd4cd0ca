"""Signing in at the panel as a browser does, with a real issuer in place of Keycloak."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import httpx
import pytest
from structlog.testing import capture_logs

from nena_shared.web.access import COOKIE
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api import oidc
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.api.session import TOKEN_LIMIT
from nena_status_aggregator.settings import (
    AggregatorHttpSettings,
    AggregatorSettings,
    HistorySettings,
    PanelOidcSettings,
)
from support.clocks import ManualClock
from support.fleet_examples import START
from support.oidc_issuer import DISCOVERY, OidcIssuer

PANEL = "http://127.0.0.1:8080/"
SESSION = "/api/v1/session"
FLEET = "/api/v1/fleet"


@pytest.fixture
def issuer(issuer: OidcIssuer) -> OidcIssuer:
    issuer.register(PANEL)
    return issuer


def panel_of(issuer: OidcIssuer, url: str = PANEL, **more: Any) -> httpx.AsyncClient:
    chosen = {**issuer.settings_of(url), **more}
    settings = AggregatorSettings(
        history=HistorySettings(url=None),
        http=AggregatorHttpSettings(port=0, oidc=PanelOidcSettings.model_validate(chosen)),
    )
    app = make_app(Aggregator(settings, ManualClock(start=START)), settings.http)
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url=url)


@pytest.fixture
async def panel(issuer: OidcIssuer) -> AsyncIterator[httpx.AsyncClient]:
    async with panel_of(issuer) as made:
        yield made


async def at_issuer(panel: httpx.AsyncClient, name: str, more: str = "") -> str:
    """Begin as ``name`` at the issuer; return its redirect."""
    offer = (await panel.get(f"{SESSION}/oidc")).json()
    sent = await panel.get(offer["start"] + more)
    assert sent.status_code == 303
    async with httpx.AsyncClient() as browser:
        back = await browser.get(f"{sent.headers['location']}&person={name}")
    assert back.status_code == 302, back.text
    return str(back.headers["location"])


def problem_of(answer: httpx.Response) -> str:
    assert answer.status_code == 303
    assert COOKIE not in answer.headers.get("set-cookie", "")
    place, _, problem = answer.headers["location"].partition("?problem=")
    assert place == f"{PANEL}login.html"
    return str(problem)


async def test_a_browser_signs_in_and_out(panel: httpx.AsyncClient) -> None:
    assert (await panel.get(FLEET)).status_code == 401
    back = await panel.get(await at_issuer(panel, "ann"))

    assert (back.status_code, back.headers["location"]) == (303, PANEL)
    assert (await panel.get(SESSION)).json() == {"user": "ann", "role": "operator"}
    assert (await panel.get(FLEET)).status_code == 200
    assert oidc.COOKIE not in panel.cookies

    await panel.delete(SESSION)
    assert (await panel.get(FLEET)).status_code == 401


async def test_the_session_ends_with_the_browser_and_scripts_do_not_get_it(panel: httpx.AsyncClient) -> None:
    back = await panel.get(await at_issuer(panel, "ann"))

    (kept,) = [each for each in back.headers.get_list("set-cookie") if each.startswith(COOKIE)]
    said = dict(part.strip().partition("=")[::2] for part in kept.split(";"))
    assert not {"Max-Age", "expires"} & said.keys()
    assert "HttpOnly" in said
    assert said["SameSite"] == "strict"


async def test_attempt_cookie_is_protected(panel: httpx.AsyncClient) -> None:
    kept = (await panel.get(f"{SESSION}/oidc/start")).headers["set-cookie"]

    assert "HttpOnly" in kept
    assert "SameSite=lax" in kept, "with strict it would not come along from the issuer's page"
    assert f"Path={SESSION}/oidc" in kept
    assert f"Max-Age={oidc.TIMEOUT}" in kept
    assert "Secure" not in kept


async def test_over_tls_both_cookies_go_over_tls_only(issuer: OidcIssuer) -> None:
    url = "https://fleet.example/panel/"
    issuer.register(url)
    async with panel_of(issuer, url) as panel:
        # a proxy in front takes the path before the panel's own away
        start = await panel.get(f"https://fleet.example{SESSION}/oidc/start")
        kept = start.headers["set-cookie"]
        assert "Secure" in kept
        assert f"Path=/panel{SESSION}/oidc" in kept


@pytest.mark.parametrize("elsewhere", ["https://evil.example/", "//evil.example", "javascript:alert(1)"])
async def test_sign_in_redirects_only_to_the_panel(panel: httpx.AsyncClient, elsewhere: str) -> None:
    names = ("next", "return_to", "redirect_uri", "redirect", "url", "target_link_uri")
    more = "".join(f"&{name}={elsewhere}" for name in names)
    back = await at_issuer(panel, "ann", f"?{more[1:]}")
    headers = {"host": "evil.example", "x-forwarded-host": "evil.example", "referer": elsewhere}

    answer = await panel.get(back + more, headers=headers)
    assert answer.headers["location"] == PANEL
    failed = await panel.get(f"{SESSION}/oidc/callback?state=x{more}", headers=headers)
    assert problem_of(failed) == "expired"


async def test_attempt_cannot_be_reused(panel: httpx.AsyncClient, issuer: OidcIssuer) -> None:
    back = await at_issuer(panel, "ann")
    attempt = panel.cookies[oidc.COOKIE]
    await panel.get(back)
    assert problem_of(await panel.get(back)) == "expired", "the attempt is gone"

    panel.cookies.set(oidc.COOKIE, attempt)
    assert problem_of(await panel.get(back)) == "refused", "the issuer takes a code once"
    assert issuer.codes == {}


async def test_sign_in_started_elsewhere_is_refused(panel: httpx.AsyncClient, issuer: OidcIssuer) -> None:
    """Check that a link cannot sign a user in to an attacker's account, which would get their data."""
    async with panel_of(issuer) as other:
        back = await at_issuer(other, "vic")

    assert problem_of(await panel.get(back)) == "expired"
    await panel.get(f"{SESSION}/oidc/start")
    assert problem_of(await panel.get(back)) == "expired"
    assert (await panel.get(FLEET)).status_code == 401


async def test_user_without_a_role_is_informed(panel: httpx.AsyncClient) -> None:
    with capture_logs() as logged:
        assert problem_of(await panel.get(await at_issuer(panel, "bob"))) == "role"
    assert "bob has no role in NeNa" in next(each for each in logged if each.get("why") == "role")["reason"]


async def test_wrong_nonce_fails_the_sign_in(panel: httpx.AsyncClient, issuer: OidcIssuer) -> None:
    issuer.id_claims = {"nonce": "another"}

    assert problem_of(await panel.get(await at_issuer(panel, "ann"))) == "unfit"
    assert (await panel.get(FLEET)).status_code == 401


async def test_unavailable_issuer_is_reported(panel: httpx.AsyncClient, issuer: OidcIssuer) -> None:
    issuer.broken[DISCOVERY] = b"gone"

    assert problem_of(await panel.get(f"{SESSION}/oidc/start")) == "away"


async def test_token_too_long_for_a_cookie_is_reported(panel: httpx.AsyncClient, issuer: OidcIssuer) -> None:
    issuer.people["ann"] += [f"role-{number}" for number in range(TOKEN_LIMIT // 5)]

    with capture_logs() as logged:
        assert problem_of(await panel.get(await at_issuer(panel, "ann"))) == "unfit"
    assert "a cookie holds" in next(each for each in logged if each.get("why") == "unfit")["reason"]
    pasted = await panel.post(SESSION, headers={"authorization": f"Bearer {issuer.token('ann')}"})
    assert (pasted.status_code, "set-cookie" in pasted.headers) == (400, False)


async def test_pasted_issuer_token_is_stored_in_a_session_cookie(
    panel: httpx.AsyncClient, issuer: OidcIssuer
) -> None:
    answer = await panel.post(SESSION, headers={"authorization": f"Bearer {issuer.token('vic')}"})

    assert answer.json() == {"user": "vic", "role": "viewer"}
    assert "Max-Age" not in answer.headers["set-cookie"]


async def test_sign_ins_have_a_limit(panel: httpx.AsyncClient) -> None:
    answers = [(await panel.get(f"{SESSION}/oidc/callback")).status_code for _ in range(oidc.AT_ONCE + 1)]

    assert answers == [303] * oidc.AT_ONCE + [429]


async def test_the_headers_of_security_are_on_every_step(panel: httpx.AsyncClient) -> None:
    for path in (f"{SESSION}/oidc", f"{SESSION}/oidc/start", f"{SESSION}/oidc/callback"):
        headers = (await panel.get(path)).headers
        assert headers["referrer-policy"] == "no-referrer", "the code goes to nobody"
        assert headers["content-security-policy"].startswith("default-src 'none'")


async def test_without_a_client_the_page_offers_none(issuer: OidcIssuer) -> None:
    async with panel_of(issuer, client_id=None, panel_url=None) as panel:
        assert (await panel.get(f"{SESSION}/oidc")).json() == {"start": None}
        assert (await panel.get(f"{SESSION}/oidc/start")).status_code == 404
        assert (await panel.get(FLEET)).status_code == 401
        told = {"authorization": f"Bearer {issuer.token('vic')}"}
        assert (await panel.get(FLEET, headers=told)).status_code == 200
