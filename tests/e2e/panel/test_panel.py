"""The page in a real browser, over a real aggregator and a real broker."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import Browser, expect

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.v2_1 import CODEC
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.fleet_examples import (
    ROBOT,
    connection,
    position,
    state,
    vehicle_status,
    way,
)
from support.panel import IN_FIREFOX, WITHIN, Hall, becomes, fits, opened, plan_shown, seconds_now

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

OTHER = RobotKey("ACME", "r2")


async def test_empty_page_has_advice(hall: Hall, browser: Browser) -> None:
    async with hall.connected(), opened(browser, hall.url) as page:
        await expect(page.get_by_text("No plant model yet")).to_be_visible()
        await expect(page.get_by_text("No robots yet")).to_be_visible()
        await expect(page.get_by_text("Robots appear once they report to the MQTT broker")).to_be_visible()
        await page.get_by_role("tab", name="Orders").click()
        await expect(page.get_by_text("No transport orders yet")).to_be_visible()
        await expect(page.locator("nena-link-banner")).to_be_hidden()


async def test_page_loads_again_if_a_module_could_not_be_loaded(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        page = await browser.new_page()
        await page.route("**/i18n.js", lambda route: route.abort("connectionreset"), times=1)
        await page.goto(hall.url)
        await expect(page.get_by_text("No robots yet")).to_be_visible(timeout=1e3 * WITHIN)
        await page.close()


async def test_robots_and_orders_are_updated_live(hall: Hall, browser: Browser) -> None:
    async with hall.connected(), opened(browser, hall.url) as page:
        hall.publish_plant()
        hall.send(Topic.CONNECTION, connection(), retain=True)
        busy = state(
            at=seconds_now(),
            order_id="o1",
            driving=True,
            last_node_id="South 1",
            last_node_sequence_id=2,
            mobile_robot_position=position(5, 2),
            **way("South 2", "South 3", "Middle 3", first=4),
        )
        hall.send(Topic.STATE, busy)
        robot = page.get_by_role("row").filter(has_text="ACME")
        await expect(robot).to_contain_text("Busy")
        await expect(robot).to_contain_text("Driving to South 2.")
        await expect(robot).to_contain_text("80 %")
        await expect(robot.get_by_role("progressbar")).to_have_attribute("value", "25")
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED)
        await page.get_by_role("tab", name="Orders").click()
        order = page.locator("tr[data-order='TO-1']")
        await expect(order).to_contain_text("In progress")
        await expect(order).to_contain_text("Goods in: Load")
        hall.publish_order(2, TransportOrderState.FINISHED)
        await expect(order).to_contain_text("Finished")
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status("r1"), vehicle, retain=True)
        await page.get_by_role("tab", name="Robots").click()
        await expect(page.get_by_role("link", name="Vehicle-1")).to_be_visible()
        hall.send(Topic.CONNECTION, connection("CONNECTION_BROKEN"), retain=True)
        await expect(page.locator("tr[data-robot='ACME/r1']")).to_contain_text("Connection broken")
        await expect(page.locator("nena-fleet-summary")).to_contain_text("1 Connection broken")


async def test_deviations_are_shown(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        plain = CODEC.encode(state(at=seconds_now()))
        hall.peer.publish(hall.robots.of(ROBOT, Topic.STATE), plain.replace(b'"errors":[]', b'"errors":null'))
        async with opened(browser, hall.url) as page:
            row = page.locator("tr[data-robot='ACME/r1']")
            await expect(row).to_contain_text("Deviates from VDA 5050")
            await page.get_by_role("link", name="r1", exact=True).click()
            section = page.locator("nena-robot-page section").filter(has_text="This robot deviates")
            await expect(section.get_by_role("listitem")).to_have_text("state.errors null: empty list")


async def test_robot_is_selected_on_the_map_and_by_keyboard(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        for robot, x in ((ROBOT, 5.0), (OTHER, 15.0)):
            here = state(robot=robot, at=seconds_now(), mobile_robot_position=position(x, 2))
            hall.send(Topic.STATE, here, robot=robot)
        async with opened(browser, hall.url) as page:
            rows = {name: page.locator(f"tr[data-robot='ACME/{name}']") for name in ("r1", "r2")}
            await expect(rows["r2"]).to_be_visible()
            canvas = page.locator("nena-fleet-map canvas")
            await expect(canvas).to_have_attribute("aria-label", re.compile("^Map of Sample hall:"))
            await plan_shown(page)
            x, y = await page.evaluate("document.querySelector('nena-fleet-map').view.toScreen(15, 2)")
            await canvas.click(position={"x": x, "y": y})
            await expect(page.locator("nena-robot-page h2")).to_have_text("r2")
            await expect(page.locator("nena-robot-page h2")).to_be_focused()
            await page.evaluate("history.back()")  # Playwright waits in vain for Firefox
            await expect(rows["r2"]).to_be_visible()
            await page.get_by_role("link", name="r1", exact=True).focus()
            await page.keyboard.press("Enter")
            await expect(page.locator("nena-robot-page h2")).to_have_text("r1")
            before = await page.evaluate("document.querySelector('nena-fleet-map').view.scale")
            await canvas.focus()
            await page.keyboard.press("+")
            scale = "document.querySelector('nena-fleet-map').view.scale"
            await becomes(page, scale, None, lambda after: after == pytest.approx(before * 1.25))


async def test_names_link_to_robot_and_map_on_a_phone(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        for number in range(1, 6):
            robot = RobotKey("ACME", f"r{number}")
            here = state(robot=robot, at=seconds_now(), mobile_robot_position=position(number, 2))
            hall.send(Topic.STATE, here, robot=robot)
        async with opened(browser, hall.url, width=390) as page:
            title = page.get_by_role("heading", name="Map")
            name = page.get_by_role("link", name="r5", exact=True)
            await name.scroll_into_view_if_needed()
            await page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
            await expect(title).not_to_be_in_viewport()
            await name.click()
            await expect(page.locator("nena-robot-page h2")).to_be_in_viewport()
            await page.get_by_role("button", name="Show on map").click()
            await expect(title).to_be_in_viewport()


async def test_page_survives_a_restart_of_the_aggregator(hall: Hall, browser: Browser) -> None:
    first = hall.aggregator()
    with first:
        await first.logged("broker connected")
        hall.send(Topic.STATE, state(at=seconds_now()))
        async with opened(browser, hall.url) as page:
            row = page.locator("tr[data-robot='ACME/r1']")
            await expect(row).to_contain_text("Idle")
            assert first.end() == 0
            banner = page.locator("nena-link-banner")
            await expect(banner).to_contain_text("Connection to the status aggregator lost")
            await expect(row).to_contain_text("Idle")
            with hall.aggregator() as second:
                await second.logged("broker connected")
                await expect(banner).to_be_hidden()
                await expect(row).to_have_count(0)
                hall.send(Topic.STATE, state(2, at=seconds_now(), operating_mode="MANUAL"))
                await expect(row).to_contain_text("Manual")


async def test_lost_broker_connection_is_shown(own_broker: Broker, browser: Browser) -> None:
    port = free_port()
    with AggregatorProcess("--http.port", str(port), "--mqtt.port", str(own_broker.port)) as aggregator:
        await aggregator.logged("broker connected")
        async with opened(browser, f"http://127.0.0.1:{port}/") as page:
            banner = page.locator("nena-link-banner")
            await expect(banner).to_be_hidden()
            own_broker.kill()
            await expect(banner).to_contain_text("not connected to the MQTT broker")
            own_broker.start()
            await expect(banner).to_be_hidden()


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.long)])
async def test_nothing_overflows_on_a_phone(hall: Hall, browser: Browser, *, dark: bool) -> None:
    async with hall.connected():
        hall.publish_plant()
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED)
        long_text = "x" * 300
        error = {"error_type": long_text, "error_level": "FATAL", "error_description": long_text}
        hall.send(Topic.STATE, state(at=seconds_now(), errors=(error,)))
        hall.peer.publish(hall.robots.of(OTHER, Topic.STATE), "{" * 300)
        async with opened(browser, hall.url, width=390, dark=dark) as page:
            await expect(page.locator("tr[data-robot='ACME/r2']")).to_be_visible()
            await page.get_by_role("tab", name="Orders").click()
            await expect(page.locator("tr[data-order='TO-1']")).to_be_visible()
            await fits(page, 390)
            if dark and IN_FIREFOX:
                pytest.skip("Playwright gives Firefox no dark theme")
            page_colour = await page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
            assert page_colour == ("rgb(15, 20, 26)" if dark else "rgb(244, 246, 248)")
