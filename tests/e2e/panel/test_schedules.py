"""Schedules in the panel, over a real order service."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from support.broker import Broker
from support.panel import findings, picture
from support.panel_site import site

pytestmark = [pytest.mark.e2e, pytest.mark.broker]


async def test_schedules_are_listed_paused_and_resumed(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        order = {"destinations": [{"locationName": "Storage", "operation": "NOP"}]}
        for name, cron in (("night-shift", "0 22 * * MON-FRI"), ("waste-2", "30 5 * * *")):
            body = {"transportOrder": order, "cron": cron, "timeZone": "Europe/Berlin"}
            assert (await orders.put(f"/v1/schedules/{name}", json=body)).status_code == 201

        await page.get_by_role("link", name="Schedules").click()
        items = page.locator("nena-schedules-page li[data-schedule]")
        await expect(items).to_have_count(2)
        night = items.filter(has_text="night-shift")
        await expect(night.locator(".chip")).to_have_text("Active")
        await expect(night).to_contain_text("0 22 * * MON-FRI (Europe/Berlin)")
        await expect(night).to_contain_text("0 orders created, 0 runs skipped")
        await expect(night.locator("time")).to_have_count(1)
        await page.get_by_role("button", name="Pause night-shift").click()
        await expect(night.locator(".chip")).to_have_text("Paused")
        await expect(night.locator("time")).to_have_count(0)
        await expect(page.get_by_text("night-shift paused; it creates no orders.")).to_be_visible()
        assert (await orders.get("/v1/schedules/night-shift")).json()["enabled"] is False
        assert await findings(page) == []
        await picture(page, "schedules")
        await page.get_by_role("button", name="Resume night-shift").click()
        await expect(night.locator(".chip")).to_have_text("Active")
        assert (await orders.get("/v1/schedules/night-shift")).json()["enabled"] is True
