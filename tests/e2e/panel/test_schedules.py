"""Schedules in the panel, over a real order service."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

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
        days = "Monday, Tuesday, Wednesday, Thursday, Friday at 22:00 (Europe/Berlin)"
        await expect(night).to_contain_text(days)
        await expect(items.filter(has_text="waste-2")).to_contain_text("Every day at 05:30 (Europe/Berlin)")
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


async def test_a_template_is_created_run_changed_into_a_schedule_and_deleted(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser, expected=("422",)) as (page, orders):
        await page.get_by_role("link", name="Schedules").click()
        await page.get_by_role("button", name="New schedule or template").click()
        form = page.get_by_role("form", name="New schedule or template")
        await expect(form.get_by_label("Name")).to_have_attribute("title", re.compile("no spaces"))
        await form.get_by_label("Name").fill("pallets")
        await pick_on_map(page, "Goods in")
        await expect(form.get_by_label("Place")).to_have_value("Goods in")
        await form.get_by_label("Operation").select_option("Load cargo")
        await form.get_by_role("button", name="Add destination").click()
        await form.get_by_label("Place").nth(1).select_option("Storage")
        await form.get_by_label("Operation").nth(1).select_option("Unload cargo")
        await form.get_by_label("When").select_option("Only when somebody runs it (template)")
        assert await findings(page) == []
        await picture(page, "schedule-form")
        await form.get_by_role("button", name="Save").click()
        await expect(page.get_by_text("pallets saved")).to_be_visible()
        item = page.locator("li[data-schedule=pallets]")
        await expect(item.locator(".chip")).to_have_text("Template")

        await page.get_by_role("button", name="Run pallets now").click()
        told = page.locator("nena-schedules-page section > .result")
        await expect(told).to_contain_text("Order pallets-")
        [created] = [
            each
            for each in (await orders.get("/v1/transportOrders")).json()["transportOrders"]
            if each["name"].startswith("pallets-")
        ]
        places = [each["destination"]["locationName"] for each in created["driveOrders"]]
        assert places == ["Goods in", "Storage"]

        await page.get_by_role("button", name="Edit pallets").click()
        form = page.get_by_role("form", name="Edit pallets")
        await expect(form.get_by_label("Place").nth(1)).to_have_value("Storage")
        await form.get_by_label("When").select_option("At a time of day")
        await form.get_by_label("Time", exact=True).fill("06:30")
        for day in ("Sat", "Sun"):
            await form.get_by_label(day).uncheck()
        await form.get_by_label("Time zone").fill("Nowhere")
        await form.get_by_role("button", name="Save").click()
        await expect(form.locator(".result")).to_contain_text("Unknown time zone 'Nowhere'")
        await form.get_by_label("Time zone").fill("Europe/Berlin")
        await form.get_by_role("button", name="Save").click()
        await expect(item.locator(".chip")).to_have_text("Active")
        stored = (await orders.get("/v1/schedules/pallets")).json()
        assert (stored["cron"], stored["timeZone"]) == ("30 6 * * MON,TUE,WED,THU,FRI", "Europe/Berlin")

        await page.get_by_role("button", name="Delete pallets").click()
        await page.get_by_role("button", name="Delete now").click()
        await expect(item).to_have_count(0)
        assert (await orders.get("/v1/schedules/pallets")).status_code == 404


async def pick_on_map(page: Page, place: str) -> None:
    """Pick a place with its button and a click on the map."""
    await page.get_by_role("button", name="Pick on map").first.click()
    at = await page.evaluate(
        """(name) => {
          const map = document.querySelector("nena-fleet-map");
          const { xMm, yMm } = map.plant.model.locations.find((each) => each.name === name);
          return map.view.toScreen(xMm / 1000, yMm / 1000);
        }""",
        place,
    )
    await page.locator("nena-fleet-map canvas").click(position={"x": at[0], "y": at[1]})
