"""Places and paths of the plant: picked on the map, locked, robots sent there; over a real order service."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from support.broker import Broker
from support.order_service_fleet import order_in
from support.panel import COLOUR_NEAR, Hall, becomes, findings, opened, picture
from support.panel_site import site
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

MAP = "document.querySelector('nena-fleet-map')"


async def click_on(page: Page, x: float, y: float) -> None:
    """Click a place of the plane on the map."""
    await becomes(
        page, f"{MAP}.canvas?.getAttribute('aria-label')", None, lambda label: "points" in (label or "")
    )
    px, py = await page.evaluate(f"{MAP}.view.toScreen({x}, {y})")
    await page.locator("nena-fleet-map canvas").click(position={"x": px, "y": py})


async def test_a_path_is_locked_and_a_robot_sent_from_the_map(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        shown = page.locator("nena-place-page")
        await click_on(page, 6, 2)
        await expect(shown.locator("h2")).to_have_text("South 1 --- South 2")
        await expect(shown).to_contain_text("No robot.")
        await page.get_by_role("button", name="Lock", exact=True).click()
        await expect(shown).to_contain_text("South 1 --- South 2 locked")
        await expect(shown.locator(".chip")).to_have_text("Path, locked")

        async def locked() -> bool:
            paths = (await orders.get("/v1/paths")).json()["paths"]
            return any(each["locked"] for each in paths if each["name"] == "South 1 --- South 2")

        await awaited(locked, bool, seconds=PATIENCE, what="the path is locked")
        await becomes(page, COLOUR_NEAR, [5, 2, "bad"], lambda found: found > 3)
        assert await findings(page) == []
        await picture(page, "path")
        await expect(page.get_by_role("button", name="Lock", exact=True)).to_be_disabled()
        await page.get_by_role("button", name="Unlock", exact=True).click()
        await expect(page.get_by_text("Robots may use this path again")).to_be_focused()
        await page.get_by_role("button", name="Unlock now").click()
        await expect(shown.locator(".chip")).to_have_text("Path")
        await awaited(locked, lambda still: not still, seconds=PATIENCE, what="it is unlocked")

        await click_on(page, 3, 7)
        await expect(shown.locator("h2")).to_have_text("Middle 1")
        form = page.get_by_role("form", name="Send a robot here")
        await form.get_by_label("Vehicle").select_option("Robot-01")
        await click_on(page, 6, 2)  # does not close a form with input
        await expect(form.get_by_label("Vehicle")).to_have_value("Robot-01")
        await form.get_by_role("button").click()
        await expect(form).to_contain_text("created")
        name = (await orders.get("/v1/transportOrders")).json()["transportOrders"][0]["name"]
        await order_in(orders, name, "FINISHED")
        await expect(shown).to_contain_text("Robot-01 is here (Idle)")
        assert await findings(page) == []


async def test_tiny_map_draws_nothing_and_has_a_full_screen_button(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        hall.publish_map()
        async with opened(browser, hall.url, width=390, height=844) as page:
            await expect(
                page.get_by_role("tab", name="Map")
            ).to_be_visible()  # the map is not, and has no size
            await page.get_by_role("tab", name="Map").click()
            await becomes(page, f"{MAP}.canvas.width", None, lambda width: width > 300)
            await page.set_viewport_size({"width": 1280, "height": 800})
            await page.get_by_role("button", name="Full screen").click()
            full = "document.fullscreenElement?.id ?? ''"
            await becomes(page, full, None, lambda found: found == "map")
            await page.get_by_role("button", name="Full screen").click()
            await becomes(page, full, None, lambda found: found == "")
