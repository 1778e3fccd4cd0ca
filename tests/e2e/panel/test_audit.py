"""The audit trail in the panel, over a real order service."""

from __future__ import annotations

import csv
from datetime import datetime, timedelta
from io import StringIO
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from support.broker import Broker
from support.panel import findings, picture, saved
from support.panel_site import site

pytestmark = [pytest.mark.e2e, pytest.mark.broker]


async def test_changes_are_listed_and_filtered(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        path = (await orders.get("/v1/paths")).json()["paths"][0]["name"]
        await orders.put(f"/v1/paths/{path}/lock", json={"locked": True})
        await orders.post("/v1/transportOrders/none/withdrawal")
        for number in range(60):
            destination = {"locationName": "Storage", "operation": "NOP"}
            body = {"name": f"T-{number}", "destinations": [destination], "intendedVehicle": "Robot-02"}
            assert (await orders.post("/v1/transportOrders", json=body)).status_code == 201

        await page.get_by_role("link", name="Audit trail").click()
        rows = page.locator("nena-audit-page li")
        await expect(rows).to_have_count(50)
        await expect(rows.first).to_contain_text("createTransportOrder T-59")
        await expect(rows.first).to_contain_text("by anonymous (REST, python-httpx")
        await page.get_by_role("button", name="Show older").click()
        await expect(rows).to_have_count(62)
        await expect(page.get_by_role("button", name="Show older")).to_be_hidden()
        await expect(rows.last).to_contain_text("Locked: no → yes")
        await expect(rows.first).to_contain_text("Destinations: Storage: Only drive there")
        await expect(rows.filter(has_text="{")).to_have_count(0)  # no JSON
        assert await findings(page) == []
        await page.locator("nena-audit-page h2").scroll_into_view_if_needed()
        await picture(page, "audit-trail")

        await page.get_by_label("Result").select_option("Refused")
        await expect(rows).to_have_count(1)
        await expect(rows).to_contain_text("UNKNOWN_ORDER")
        await page.get_by_label("Result").select_option("All")
        await page.get_by_label("Object").fill(path)
        await page.keyboard.press("Enter")
        await expect(rows).to_have_count(1)
        await page.reload()
        await expect(page.get_by_label("Object")).to_have_value(path)
        await expect(rows).to_have_count(1)
        await page.get_by_label("Object").fill("nothing")
        await page.keyboard.press("Enter")
        await expect(page.get_by_text("No changes found.")).to_be_visible()


async def test_time_range_is_chosen_and_saved_as_csv(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        body = {"name": "-T-1", "destinations": [{"locationName": "Storage", "operation": "NOP"}]}
        assert (await orders.post("/v1/transportOrders", json=body)).status_code == 201
        await page.get_by_role("link", name="Audit trail").click()
        rows = page.locator("nena-audit-page li")
        await expect(rows).to_have_count(1)
        tomorrow = datetime.now() + timedelta(days=1)  # noqa: DTZ005 - local time, as in the page
        await page.get_by_label("From", exact=True).fill(f"{tomorrow:%Y-%m-%dT%H:%M}")
        await page.get_by_label("From", exact=True).blur()
        await expect(rows).to_have_count(0)
        await page.reload()
        await expect(page.get_by_label("From", exact=True)).to_have_value(f"{tomorrow:%Y-%m-%dT%H:%M}")
        await page.get_by_label("From", exact=True).fill("")
        await page.get_by_label("To", exact=True).fill(f"{tomorrow:%Y-%m-%dT%H:%M}")
        await page.get_by_label("To", exact=True).blur()
        await expect(rows).to_have_count(1)
        text = await saved(page, page.get_by_role("button", name="Download CSV"), tmp_path)
        [row] = csv.DictReader(StringIO(text, newline=""))
        assert (row["operation"], row["object"], row["result"]) == ("createTransportOrder", "'-T-1", "DONE")
        assert len(row["hash"]) == 64
        await expect(page.get_by_text("1 row saved.")).to_be_visible()
