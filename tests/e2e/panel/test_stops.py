"""Stops of all robots and of an area, begun and ended in the panel; over a real order service and robot."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Locator, Page, expect

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet
from support.panel import COLOUR_NEAR, becomes, findings, opened, picture
from support.panel_site import panel_site, site
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]


async def stops_are(orders: httpx.AsyncClient, *paused: int) -> list[dict[str, Any]]:
    """Wait until these numbers of robots are paused by the active stops."""

    async def stops() -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = (await orders.get("/v1/stops")).json()["stops"]
        return found

    return await awaited(
        stops,
        lambda found: [each["paused"] for each in found] == [*paused],
        seconds=PATIENCE,
        what=f"stops with {paused} paused robots",
    )


def robot(page: Page) -> Locator:
    return page.locator("tr[data-robot]").filter(has_text="Robot-01")


def banner(page: Page) -> Locator:
    return page.locator("nena-stops .stop")


async def test_all_robots_are_stopped_and_released(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        await page.get_by_role("button", name="Stop all").click()
        await expect(page.get_by_label("Your name")).to_be_focused()
        await page.get_by_label("Your name").fill("Anna")
        await page.get_by_label("Reason").fill("fire drill")
        assert await findings(page) == []
        await page.get_by_role("button", name="Stop all robots").click()
        await expect(banner(page)).to_contain_text("All robots paused by Anna")
        await expect(banner(page)).to_contain_text("fire drill")
        await expect(banner(page)).to_contain_text("1 of 1 robots paused")
        await expect(robot(page)).to_contain_text("Paused with all robots by Anna: fire drill")
        await stops_are(orders, 1)
        assert await findings(page) == []

        await banner(page).get_by_role("button", name="End …").click()
        await expect(banner(page).get_by_label("Your name")).to_have_value("Anna")
        await banner(page).get_by_label("Reason").fill("over")
        await banner(page).get_by_role("button", name="End stop").click()
        await expect(banner(page)).to_have_count(0)
        await stops_are(orders)
        await expect(robot(page)).to_contain_text("Idle")


async def begin_stop(page: Page) -> None:
    await page.get_by_role("button", name="Stop all").click()
    await page.get_by_label("Your name").fill("Anna")
    await page.get_by_label("Reason").fill("fire drill")
    await page.get_by_role("button", name="Stop all robots").click()


async def test_all_robots_are_stopped_and_released_without_the_order_service(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with panel_site(broker, interface_name, tmp_path, browser, expected=("502",)) as shown:
        page = shown.page
        shown.order_service.process.kill()
        await begin_stop(page)
        await expect(banner(page)).to_contain_text("All robots paused by Anna")
        await expect(banner(page).get_by_text("The order service does not answer")).to_be_visible()
        await expect(banner(page)).to_contain_text("1 of 1 robots paused")
        await expect(robot(page)).to_contain_text("Paused")
        await page.locator("nena-attention-button button").click()
        matter = page.locator("nena-attention li").filter(has_text="Robots stopped")
        await expect(matter).to_contain_text("All robots paused by Anna")
        await expect(matter).not_to_contain_text("stop-")
        await page.locator("nena-attention-button button").click()
        assert await findings(page) == []
        await picture(page, "stopped-without-order-service")

        await expect(page.get_by_text("The order service is down")).to_be_visible()
        await page.get_by_role("button", name="Stop area").click()
        await expect(page.get_by_text("only it can stop an area")).to_be_visible()
        await banner(page).get_by_role("button", name="End …").click()
        await banner(page).get_by_label("Reason").fill("over")
        await banner(page).get_by_role("button", name="End stop").click()
        await expect(banner(page)).to_have_count(0)
        await expect(robot(page)).not_to_contain_text("Paused")


async def test_robots_that_do_not_confirm_are_named_with_what_to_do(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with panel_site(broker, interface_name, tmp_path, browser) as shown:
        shown.agent.process.send_signal(signal.SIGSTOP)
        others = banner(shown.page)
        try:
            await begin_stop(shown.page)
            await expect(others).to_contain_text("Waiting up to 10 s for the confirmation of 1: Robot-01")
            late = "1 not confirmed after 10 s. Walk there"
            await expect(others).to_contain_text(late, timeout=PATIENCE * 1000)
            await expect(others).to_contain_text("Robot-01")
            assert await findings(shown.page) == []
            await picture(shown.page, "stop-not-confirmed")
        finally:
            shown.agent.process.send_signal(signal.SIGCONT)
        await expect(others).to_contain_text("1 of 1 robots paused", timeout=PATIENCE * 1000)
        await expect(others.get_by_text("Walk there")).to_be_hidden()
        await expect(others.get_by_text("The order service does not answer")).to_be_hidden()


async def test_area_is_drawn_on_the_map_and_paused(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path, browser) as (page, orders):
        await page.get_by_role("button", name="Stop area").click()
        await expect(page.get_by_text("Drag from one corner")).to_be_visible()
        box = await page.locator("nena-fleet-map canvas").bounding_box()
        assert box
        view = "document.querySelector('nena-fleet-map').view"
        (x, y), (right, top) = [await page.evaluate(f"{view}.toScreen({at})") for at in ("2, 1", "5, 3")]
        await page.mouse.move(box["x"] + x, box["y"] + y)
        await page.mouse.down()
        await page.mouse.move(box["x"] + right, box["y"] + top, steps=4)
        await page.mouse.up()
        await expect(page.get_by_label("Your name")).to_be_focused()
        await page.get_by_label("Your name").fill("Anna")
        await page.get_by_label("Reason").fill("oil on the floor")
        await page.get_by_role("button", name="Stop this area").click()
        await expect(banner(page)).to_contain_text("Area paused by Anna")
        await expect(robot(page)).to_contain_text("Paused with this area by Anna: oil on the floor")
        (stop,) = await stops_are(orders, 1)
        assert stop["area"]["xMax"] - stop["area"]["xMin"] == pytest.approx(3, abs=0.2)
        await becomes(page, COLOUR_NEAR, [2, 2, "blocked"], lambda found: found > 3)
        paths = (await orders.get("/v1/paths")).json()["paths"]
        assert "South 1 --- South 2" in [each["name"] for each in paths if each["stop"]]
        assert await findings(page) == []
        await picture(page, "area-paused")

        await page.evaluate("location.hash = '#/places/' + encodeURIComponent('South 1 --- South 2')")
        await expect(page.get_by_text("A stop of this area locks the path")).to_be_visible()
        unlock = page.get_by_role("button", name="Unlock", exact=True)
        await expect(unlock).to_be_disabled()
        assert await findings(page) == []
        await orders.put("/v1/paths/South%201%20---%20South%202/lock", json={"locked": True})
        await orders.post(f"/v1/stops/{stop['name']}/end")
        await expect(unlock).to_be_enabled()
        await expect(page.get_by_text("A stop of this area locks the path")).to_be_hidden()


@pytest.mark.long
async def test_panel_without_commands_shows_the_banner_without_buttons(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    fleet, port = Fleet(broker, interface_name, tmp_path), free_port()
    with fleet.stack:
        service = fleet.order_service()
        async with await service.client() as orders:
            await orders.post("/v1/stops", json={"by": "Anna", "reason": "fire drill"})
            options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
            addresses = ("--http.port", str(port), "--mqtt.port", str(broker.port))
            with AggregatorProcess(*addresses, *options) as aggregator:  # without commands
                await aggregator.logged("broker connected")
                async with opened(browser, f"http://127.0.0.1:{port}/", language="de-DE") as page:
                    banner = page.locator("nena-stops .stop")
                    await expect(banner).to_contain_text("Alle Roboter pausiert von Anna")
                    await expect(page.locator("nena-stops button, nena-stop-commands button")).to_have_count(
                        0
                    )
