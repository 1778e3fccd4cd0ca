"""Signing in at the panel by an OpenID Connect issuer, in a real browser.

The issuer on loopback replaces Keycloak, Entra ID and the like, which are not available here. For the browser
it is another site (localhost) than the panel (127.0.0.1): cookies behave as at a real one.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.vda5050.topics import Topic
from nena_shared.web.access import COOKIE
from support.broker import free_port
from support.fleet_examples import connection, position, state, vehicle_status
from support.oidc_issuer import DISCOVERY, OidcIssuer
from support.panel import Hall, findings, opened, picture, seconds_now

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

UNKNOWN = ("401", "502")
BUTTON = "Sign in with your organisation's account"


@pytest.fixture
def issuer(issuer: OidcIssuer, hall: Hall) -> OidcIssuer:
    issuer.register(hall.url)
    return issuer


@asynccontextmanager
async def aggregator(hall: Hall, issuer: OidcIssuer) -> AsyncIterator[None]:
    """Run the aggregator, with a robot in the hall."""
    oidc = issuer.settings_of(hall.url)
    options = [part for name, value in oidc.items() for part in (f"--http.oidc.{name}", value)]
    async with hall.connected(*options, "--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.publish_plant()
        hall.send(Topic.CONNECTION, connection(), retain=True)
        here = state(at=seconds_now(), last_node_id="South 1", mobile_robot_position=position(5, 2))
        hall.send(Topic.STATE, here, retain=True)
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status("r1"), vehicle, retain=True)
        yield


async def sign_in(page: Page, name: str) -> None:
    await page.get_by_role("link", name=BUTTON).click()
    await page.get_by_role("link", name=name).click()


async def test_operator_signs_in_with_oidc_and_signs_out(
    hall: Hall, issuer: OidcIssuer, browser: Browser
) -> None:
    async with aggregator(hall, issuer), opened(browser, hall.url, expected=UNKNOWN) as page:
        await expect(page.get_by_role("link", name=BUTTON)).to_be_visible()
        await picture(page, "sign-in")
        assert await findings(page) == []

        await sign_in(page, "ann")
        row = page.locator("tr[data-robot='ACME/r1']")
        await expect(row).to_be_visible()
        assert page.url == hall.url
        await expect(page.locator("nena-user-menu")).to_contain_text("ann")
        await row.get_by_role("link").click()
        await expect(page.get_by_role("button", name="Pause")).to_be_visible()
        await page.reload()
        await expect(page.get_by_role("button", name="Pause")).to_be_visible()
        cookies = await page.context.cookies(hall.url)
        assert [each["name"] for each in cookies] == [COOKIE]
        assert (cookies[0]["httpOnly"], cookies[0]["sameSite"]) == (True, "Strict")
        assert cookies[0]["expires"] == -1, "it ends with the browser"

        await page.get_by_role("button", name="Sign out").click()
        await expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
        assert await page.context.cookies(hall.url) == []


async def test_missing_role_is_shown_on_the_page(hall: Hall, issuer: OidcIssuer, browser: Browser) -> None:
    async with aggregator(hall, issuer), opened(browser, hall.url, expected=UNKNOWN) as page:
        await sign_in(page, "bob")
        await expect(page.get_by_role("alert")).to_contain_text("Your account has no role in NeNa.")
        assert await findings(page) == []

        await sign_in(page, "vic")
        await expect(page.locator("tr[data-robot='ACME/r1']")).to_be_visible()


async def test_unavailable_issuer_is_shown_on_the_page(
    hall: Hall, issuer: OidcIssuer, browser: Browser
) -> None:
    issuer.broken[DISCOVERY] = b"gone"
    async with aggregator(hall, issuer), opened(browser, hall.url, expected=UNKNOWN) as page:
        await page.get_by_role("link", name=BUTTON).click()
        await expect(page.get_by_role("alert")).to_contain_text("is not responding")


async def test_link_appears_although_the_first_request_for_it_fails(
    hall: Hall, issuer: OidcIssuer, browser: Browser
) -> None:
    async with aggregator(hall, issuer), opened(browser, f"{hall.url}login.html") as page:
        await page.route("**/session/oidc", lambda route: route.abort(), times=1)
        await page.reload()
        await expect(page.get_by_role("link", name=BUTTON)).to_be_visible()
