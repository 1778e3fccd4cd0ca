"""Recordings of the order service: the history page lists them and requests new ones."""

from __future__ import annotations

import pytest
from playwright.async_api import Browser, Page, Route, expect

from support.panel import Hall, findings, opened

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

NO_ORDER_SERVICE = ("404",)
"""The browser's error for what only an order service answers."""
NAME = "20261127T095300.123Z-request.mcap"
RECORDING = {
    "robot": "nena/order-service",
    "name": NAME,
    "size": 2048,
    "received": "2026-11-27T09:53:01.000Z",
}


async def with_answers(page: Page) -> list[str]:
    """Answer for the order service, and list its recording once it is requested; return the requests."""
    requests: list[str] = []

    async def fetch(route: Route) -> None:
        requests.append(f"{route.request.method} {route.request.url.partition('/control/')[2]}")
        await route.fulfill(json={"robot": RECORDING["robot"], "name": NAME, "sent": True})

    async def listed(route: Route) -> None:
        await route.fulfill(json=[RECORDING] if requests else [])

    await page.route("**/api/v1/control", lambda route: route.fulfill(json={"enabled": True}))
    await page.route("**/api/v1/control/recordings", fetch)
    await page.route("**/api/v1/recordings?robot=nena%2Forder-service", listed)
    return requests


async def test_a_recording_of_the_order_service_is_requested(hall: Hall, browser: Browser) -> None:
    async with hall.connected(), opened(browser, hall.url, expected=NO_ORDER_SERVICE) as page:
        requests = await with_answers(page)
        await expect(page.get_by_role("link", name="History")).to_be_visible()  # all of the page is loaded
        await page.reload()
        await page.get_by_role("link", name="History").click()
        heading = page.get_by_role("heading", name="Recordings of the order service")
        section = page.locator("nena-history-page section", has=heading)
        await expect(section).to_contain_text("No recordings.")
        await expect(page.locator("nena-history-page h3").last).to_have_text(await heading.inner_text())
        await section.get_by_role("button", name="Fetch recording").click()

        link = section.get_by_role("link", name=NAME)
        await expect(link).to_have_attribute("href", f"api/v1/recordings/nena/order-service/{NAME}")
        await expect(section).to_contain_text("Recording of the order service requested")
        assert requests == ["POST recordings"]
        assert await findings(page) == []
