"""The pages that describe the order service's REST API, in a real browser."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.base import Role
from nena_shared.web.users import User, hash_of, write_users
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, running
from support.panel import opened

pytestmark = [pytest.mark.e2e, pytest.mark.broker]


@pytest.fixture
async def service(broker: Broker, interface_name: str, tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """Yield an order service with one user, a viewer with the token "right"."""
    fleet, users = Fleet(broker, interface_name, tmp_path), tmp_path / "users.toml"
    write_users(users, [User(name="host", role=Role.VIEWER, token_sha256=hash_of("right"))])
    with fleet.stack:
        async with running(fleet.settings(http={"port": free_port(), "users": users})) as client:
            yield client


async def log_in(page: Page, token: str) -> None:
    await page.get_by_label("API token").fill(token)
    await page.get_by_role("button", name="Show").click()


async def test_requests_are_tried_with_a_token(browser: Browser, service: httpx.AsyncClient) -> None:
    async with opened(browser, f"{service.base_url}/docs", expected=("401",)) as page:
        await log_in(page, "wrong")
        await expect(page.locator("output")).not_to_be_empty()
        await log_in(page, "right")
        await page.get_by_text("/v1/vehicles", exact=True).click()
        await page.get_by_role("button", name="Try it out").click()
        await page.get_by_role("button", name="Execute", exact=True).click()
        await expect(page.locator(".live-responses-table .response").get_by_text("200")).to_be_visible()
        await expect(page.get_by_label("API token")).to_be_hidden()


async def test_the_api_is_read_as_one_page(browser: Browser, service: httpx.AsyncClient) -> None:
    async with opened(browser, f"{service.base_url}/redoc", expected=("401",)) as page:
        await log_in(page, "right")
        await expect(page.get_by_role("heading", name="NeNa order service")).to_be_visible()
