"""Logging in to the panel, in a real browser, and what each role finds there."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.base import Role
from nena_shared.vda5050.topics import Topic
from nena_shared.web.users import User, hash_of, new_token, write_users
from support.broker import free_port
from support.fleet_examples import connection, position, state, vehicle_status
from support.panel import Hall, findings, fits, opened, picture, seconds_now

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

UNKNOWN = ("401", "502")
"""What the browser says of each answer to somebody unknown, and of the order service, which is not there."""


class Site:
    """A hall whose panel requires a login: a token for each role, by the role's name."""

    def __init__(self, hall: Hall, file: Path) -> None:
        self.hall = hall
        self.file = file
        self.tokens = {role.name.lower(): new_token() for role in Role}
        self.set_users(*self.tokens)

    def set_users(self, *names: str) -> None:
        """Restrict the users to these."""
        users = [
            User(name=name, role=Role[name.upper()], token_sha256=hash_of(self.tokens[name]))
            for name in names
        ]
        write_users(self.file, users)

    @asynccontextmanager
    async def aggregator(self) -> AsyncIterator[None]:
        """Run the aggregator, with a robot in the hall."""
        options = ("--http.users", str(self.file), "--order_service.url", f"http://127.0.0.1:{free_port()}")
        async with self.hall.connected(*options):
            self.hall.publish_plant()
            self.hall.send(Topic.CONNECTION, connection(), retain=True)
            here = state(at=seconds_now(), last_node_id="South 1", mobile_robot_position=position(5, 2))
            self.hall.send(Topic.STATE, here, retain=True)
            vehicle = vehicle_status().model_dump_json(by_alias=True)
            self.hall.peer.publish(self.hall.fleet.vehicle_status("r1"), vehicle, retain=True)
            yield

    async def log_in(self, page: Page, name: str) -> None:
        """Log in as a user does."""
        await page.get_by_label("Token").fill(self.tokens[name])
        await page.keyboard.press("Enter")


@pytest.fixture
def site(hall: Hall, tmp_path: Path) -> Site:
    return Site(hall, tmp_path / "users.toml")


async def test_an_operator_logs_in_works_and_logs_out(site: Site, browser: Browser) -> None:
    async with site.aggregator(), opened(browser, site.hall.url, expected=UNKNOWN) as page:
        await expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
        await picture(page, "login")
        assert await findings(page) == []
        await page.get_by_label("Token").fill("nena_of-nobody")
        await page.get_by_role("button", name="Sign in").click()
        await expect(page.get_by_role("alert")).to_have_text("Unknown token. Did you copy all of it?")

        await site.log_in(page, "operator")
        row = page.locator("tr[data-robot='ACME/r1']")
        await expect(row).to_be_visible()
        await expect(page.locator("nena-user-menu")).to_contain_text("operator")
        await row.get_by_role("link").click()
        await expect(page.get_by_role("button", name="Pause")).to_be_visible()
        await page.reload()
        await expect(page.get_by_role("button", name="Pause")).to_be_visible()

        await page.get_by_role("button", name="Sign out").click()
        await expect(page.get_by_role("heading", name="Sign in")).to_be_visible()
        await page.goto(site.hall.url)
        await expect(page.get_by_role("heading", name="Sign in")).to_be_visible()


async def test_viewer_has_read_only_access(site: Site, browser: Browser) -> None:
    async with site.aggregator(), opened(browser, site.hall.url, expected=UNKNOWN) as page:
        await site.log_in(page, "viewer")
        await page.locator("tr[data-robot='ACME/r1']").get_by_role("link").click()
        await expect(page.get_by_role("heading", name="Why is it not moving?")).to_be_visible()
        await expect(page.get_by_role("button", name="Pause")).to_be_hidden()
        await page.locator("nena-fleet-map canvas").focus()
        await page.keyboard.press("Shift+F10")
        await expect(page.locator("nena-map-menu")).to_be_hidden()
        assert await page.locator("nena-map-menu").text_content() == ""
        await expect(page.get_by_role("button", name="Stop all")).to_have_count(0)
        await expect(page.get_by_role("link", name="New order")).to_be_hidden()
        await expect(page.get_by_role("link", name="Audit trail")).to_be_hidden()
        await page.get_by_role("link", name="All robots and orders").click()
        await expect(page.locator("tr[data-robot='ACME/r1']")).to_be_visible()
        await expect(page.get_by_role("checkbox")).to_have_count(0)
        await page.go_back()
        await expect(page.get_by_text("Read-only access")).to_be_visible()


async def test_administrator_finds_the_audit_trail(site: Site, browser: Browser) -> None:
    async with site.aggregator(), opened(browser, site.hall.url, expected=UNKNOWN) as page:
        await site.log_in(page, "admin")
        await page.get_by_role("link", name="Audit trail").click()
        await expect(page.get_by_text("Not available: No answer from the order service")).to_be_visible()


async def test_removed_user_is_sent_to_the_login_page(site: Site, browser: Browser) -> None:
    async with site.aggregator(), opened(browser, site.hall.url, expected=UNKNOWN) as page:
        await site.log_in(page, "viewer")
        await expect(page.locator("tr[data-robot='ACME/r1']")).to_be_visible()
        site.set_users("operator")
        await page.reload()
        await expect(page.get_by_role("heading", name="Sign in")).to_be_visible()


@pytest.mark.parametrize(("language", "title"), [("nl-NL", "Aanmelden"), ("de-DE", "Anmelden")])
async def test_login_page_uses_the_browser_language_on_a_phone(
    site: Site, browser: Browser, language: str, title: str
) -> None:
    async with (
        site.aggregator(),
        opened(browser, site.hall.url, language=language, width=390, expected=UNKNOWN) as page,
    ):
        await expect(page.get_by_role("heading", name=title)).to_be_visible()
        await fits(page, 390)
