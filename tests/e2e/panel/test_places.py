"""Places and paths of the plant: picked on the map, locked, robots sent there; over a real order service."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from support.broker import Broker, free_port
from support.order_service_fleet import order_in
from support.panel import COLOUR_NEAR, IN_FIREFOX, Hall, becomes, findings, opened, picture, plan_shown
from support.panel_site import site
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

MAP = "document.querySelector('nena-fleet-map')"


async def click_on(page: Page, x: float, y: float, button: Literal["left", "right"] = "left") -> None:
    """Click a place of the plane on the map."""
    px, py = await page.evaluate(f"{MAP}.view.toScreen({x}, {y})")
    await page.locator("nena-fleet-map canvas").click(position={"x": px, "y": py}, button=button)


async def test_a_path_is_locked_and_a_robot_sent_from_the_map(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        shown = page.locator("nena-place-page")
        await click_on(page, 6, 2)
        await expect(shown.locator("h2")).to_have_text("South 1 --- South 2")
        await expect(shown).to_contain_text("No robot.")
        await page.evaluate("window.prompt = () => null")
        await page.get_by_role("button", name="Lock", exact=True).click()
        await expect(shown).to_contain_text("Not sent: enter your name first")
        await page.evaluate("window.prompt = () => ' Kim '")  # asked for once
        await page.get_by_role("button", name="Lock", exact=True).click()
        await expect(shown).to_contain_text("South 1 --- South 2 locked")
        await expect(shown.locator(".chip")).to_have_text("Path, locked")
        await expect(shown).to_contain_text("by Kim since")
        assert await page.evaluate("localStorage.getItem('nena-person')") == "Kim"

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
        await form.get_by_label("Robot").select_option("Robot-01")
        await click_on(page, 6, 2)  # does not close a form with input
        await expect(form.get_by_label("Robot")).to_have_value("Robot-01")
        await form.get_by_role("button").click()
        await expect(form).to_contain_text("created")
        name = (await orders.get("/v1/transportOrders")).json()["transportOrders"][0]["name"]
        await order_in(orders, name, "FINISHED")
        await expect(shown).to_contain_text("Robot-01 is here (Idle)")
        assert await findings(page) == []


def _marked(found: int) -> bool:
    return found > 3


def _plain(found: int) -> bool:
    return not _marked(found)


async def test_a_lock_by_others_is_on_the_map_once_it_is_listed(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        await page.add_init_script("window.setInterval = () => 0")  # without a look every few seconds
        await page.reload()
        await plan_shown(page)
        for locked in (True, False, True):
            await orders.put("/v1/paths/South 1 --- South 2/lock", json={"locked": locked})
            listed = page.locator("nena-attention li").filter(has_text="Path locked")
            await expect(listed).to_have_count(int(locked))
            await becomes(page, COLOUR_NEAR, [5, 2, "bad"], _marked if locked else _plain)


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


async def test_the_maps_menu_begins_commands_of_robots_and_places(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        menu = page.get_by_role("menu")
        await click_on(page, 6, 2, button="right")
        await expect(menu.get_by_role("menuitem", name="Details")).to_be_focused()
        assert await findings(page) == []
        await page.keyboard.press("Escape")
        await expect(menu).to_be_hidden()
        await expect(page.locator("nena-fleet-map canvas")).to_be_focused()
        assert await page.evaluate("location.hash") in ("", "#/")  # a right click selects nothing
        await click_on(page, 6, 2, button="right")
        await menu.get_by_role("menuitem", name="Lock", exact=True).click()
        await expect(page.locator("nena-place-page .chip")).to_have_text("Path, locked")
        await page.locator("nena-fleet-map canvas").focus()
        await page.keyboard.press("Shift+F10")  # of the selected path
        await page.keyboard.press("ArrowDown")
        await expect(menu.get_by_role("menuitem", name="Unlock")).to_be_focused()
        await page.keyboard.press("Enter")
        await page.get_by_role("button", name="Unlock now").click()
        await expect(page.locator("nena-place-page .chip")).to_have_text("Path")
        await click_on(page, 3, 7, button="right")
        await menu.get_by_role("menuitem", name="Send a robot here").click()
        await expect(page.get_by_role("form", name="Send a robot here").get_by_label("Robot")).to_be_focused()
        await a_robots_level_is_set(page, orders)


async def a_robots_level_is_set(page: Page, orders: httpx.AsyncClient) -> None:
    x, y = await page.evaluate(f"(({{ x, y }}) => [x, y])([...{MAP}.store.robots.values()][0].position)")
    menu = page.get_by_role("menu", name="Commands for Robot-01")
    await click_on(page, x, y, button="right")
    in_use = menu.get_by_role("menuitemradio", name="In use: gets orders")
    await expect(in_use).to_be_checked()
    assert await findings(page) == []
    await picture(page, "map-menu")
    await menu.get_by_role("menuitemradio", name="Shown only").click()
    form = page.get_by_role("form", name="In or out of use")
    await expect(form.locator("select")).to_have_value("TO_BE_NOTICED")
    await form.get_by_label("Robot-01 is not in the way of other robots").check()
    await form.get_by_role("button", name="Apply").click()
    await expect(form).to_contain_text("Shown only")

    async def level() -> str:
        found: str = (await orders.get("/v1/vehicles/Robot-01")).json()["integrationLevel"]
        return found

    await awaited(level, lambda found: found == "TO_BE_NOTICED", seconds=PATIENCE, what="the level is set")


async def test_a_long_press_opens_the_maps_menu(hall: Hall, browser: Browser) -> None:
    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.publish_plant()
        async with opened(browser, hall.url, touch=True, expected=("502",)) as page:
            await plan_shown(page)
            box = await page.locator("nena-fleet-map canvas").bounding_box()
            assert box is not None
            x, y = await page.evaluate(f"{MAP}.view.toScreen(3, 7)")
            menu = page.get_by_role("menu", name="Commands for Middle 1")
            details = menu.get_by_role("menuitem", name="Details")
            if (
                IN_FIREFOX
            ):  # Playwright sends it no touch, and a tap is nothing: the page gets the events alone
                canvas = page.locator("nena-fleet-map canvas")
                finger = {"pointerType": "touch", "clientX": box["x"] + x, "clientY": box["y"] + y}
                await canvas.hover()  # the pointer with the number 0 is known from now on
                await canvas.dispatch_event("pointerdown", finger)
                await expect(menu).to_be_visible()
                await canvas.dispatch_event("pointerup", finger)
                await details.click()
            else:
                session = await page.context.new_cdp_session(page)
                points = [{"x": box["x"] + x, "y": box["y"] + y}]
                await session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points})
                await expect(menu).to_be_visible()
                await session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
                await details.tap()
            await expect(page.locator("nena-place-page h2")).to_have_text("Middle 1")
