"""Commands of an operator, with a real browser, order service and edge agent."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from math import pi
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Locator, Page, Route, expect

from nena_shared.vda5050.topics import Topic
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.fleet_examples import position, state, vehicle_status
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.panel import Hall, findings, opened, picture, plan_shown, seconds_now, visit
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

ROBOT = "#/robots/NeNa%2Frobot-01"
REFUSALS = ("409", "422")  # the browser writes each answer of an error into its console
SLOW = 0.1
"""m/s"""


@dataclass
class Operated:
    """A fleet of one robot at South 1, and its panel."""

    orders: httpx.AsyncClient
    url: str

    async def last_order(self) -> str:
        """Wait for an order, and return the name of the newest one."""

        async def look() -> list[str]:
            answer = (await self.orders.get("/v1/transportOrders")).json()
            return [order["name"] for order in answer["transportOrders"]]

        return (await awaited(look, bool, seconds=PATIENCE, what="there is an order"))[0]

    async def robot(self) -> dict[str, float]:
        """Position of the robot."""
        found: dict[str, float] = (await self.orders.get("/v1/vehicles/Robot-01")).json()["precisePosition"]
        return found

    async def robot_at(self, x: float, y: float) -> dict[str, float]:
        """Wait until the robot is within half a metre of a place."""
        return await awaited(
            self.robot,
            lambda at: abs(at["x"] - x) < 0.5 and abs(at["y"] - y) < 0.5,
            seconds=PATIENCE,
            what=f"the robot is at {x}, {y}",
        )


@asynccontextmanager
async def operated(
    broker: Broker, interface_name: str, folder: Path, *, speed: float = 40.0
) -> AsyncIterator[Operated]:
    fleet = Fleet(broker, interface_name, folder)
    with fleet.stack:
        fleet.agent(speed=speed)
        service = fleet.order_service("--engine.instant_action_timeout", PATIENCE)  # else: "still running"
        async with await service.client() as orders:
            await vehicle_idle(orders)
            port = free_port()
            options = [
                *("--http.port", str(port), "--mqtt.port", str(broker.port)),
                *("--interface_name", interface_name, "--topic_prefix", fleet.prefix),
                *("--order_service.url", str(orders.base_url), "--order_service.timeout", str(PATIENCE)),
            ]
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                yield Operated(orders, f"http://127.0.0.1:{port}/")


def button(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


async def test_an_order_is_created_watched_to_its_end_and_read_about(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path, speed=2.0) as fleet,
        opened(browser, fleet.url) as page,
    ):
        await page.get_by_role("link", name="New order").click()
        form = page.get_by_role("form", name="New transport order")
        await form.get_by_label("Place").select_option("Goods in")
        await expect(form.get_by_label("Operation").locator("option")).to_have_text(
            ["Load cargo", "Only drive there"]
        )
        await form.get_by_label("Operation").select_option("Load cargo")
        await button(page, "Add destination").click()
        await form.get_by_label("Place").nth(1).select_option("Storage")
        await form.get_by_label("Operation").nth(1).select_option("Unload cargo")
        await form.get_by_label("Robot").select_option("Robot-01")
        await form.get_by_label("Name").fill("Pallet-1")
        await expect(page.get_by_text("1 Idle")).to_be_visible()
        await picture(page, "new-order")
        await button(page, "Create order").click()
        await expect(page.get_by_role("heading", name="Pallet-1")).to_be_visible()
        shown = page.locator("nena-order-page")
        await expect(shown).to_contain_text("In progress")
        await expect(shown).to_contain_text("In progress.")
        await expect(shown.locator(".history")).to_contain_text("Assigned")
        await picture(page, "order")
        await expect(shown.locator(".chip")).to_have_text("Finished")
        await expect(shown.locator(".stops")).to_contain_text("Goods in: Load cargo done")
        await expect(shown.locator(".history")).to_contain_text("Ended")
        await expect(button(page, "Withdraw")).to_be_disabled()
        await page.get_by_role("link", name="All robots and orders").click()
        row = page.locator("tr[data-order='Pallet-1']")
        await page.get_by_role("tab", name="Orders").click()
        await expect(row).to_be_visible()
        await button(page, "Finished 1").click()
        await expect(row).to_be_visible()
        await page.get_by_label("Search").fill("storage")
        await expect(row).to_be_visible()
        await page.get_by_label("Search").fill("nowhere")
        await expect(row).to_be_hidden()


async def test_integration_level_is_set_and_a_drive_off_the_paths_is_noted(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path) as fleet,
        opened(browser, fleet.url + ROBOT) as page,
    ):
        await button(page, "In or out of use …").click()
        form = page.get_by_role("form", name="In or out of use")
        await expect(form.get_by_label("In or out of use")).to_have_value("TO_BE_UTILIZED")
        await form.get_by_label("In or out of use").select_option("TO_BE_IGNORED")
        await expect(form).to_contain_text("other robots no longer avoid it")
        sure = form.get_by_role("checkbox", name="Robot-01 is not in the way of other robots")
        await button(page, "Apply").click()
        await expect(sure).to_be_focused()  # required
        assert await findings(page) == []
        await form.get_by_label("In or out of use").select_option("TO_BE_RESPECTED")
        await expect(sure).to_have_count(0)
        await button(page, "Apply").click()
        await expect(form.get_by_role("status")).to_contain_text("Out of use")
        chips = page.locator("nena-fleet-summary")
        await expect(chips).to_contain_text("1 Out of use")
        await expect(chips.get_by_role("button", name="Idle")).to_be_hidden()
        vehicle = (await fleet.orders.get("/v1/vehicles/Robot-01")).json()
        assert vehicle["integrationLevel"] == "TO_BE_RESPECTED"

        await button(page, "Dispatch …").click()
        form = page.get_by_role("form", name="Dispatch")
        await form.locator("select[name=kind]").select_option("coordinate")
        await form.get_by_label("x in m").fill("9")
        await form.get_by_label("y in m").fill("2")  # South 2
        note = form.get_by_text("away from the paths")
        await expect(note).to_have_count(0)
        await form.get_by_label("y in m").fill("5")
        await expect(note).to_be_visible()


async def test_dispatch_to_a_point_and_cancel(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path, speed=SLOW) as fleet,
        opened(browser, fleet.url + ROBOT) as page,
    ):
        await button(page, "Dispatch …").click()
        form = page.get_by_role("form", name="Dispatch")
        await form.get_by_label("Place").select_option("South 3")
        await button(page, "Dispatch").click()
        name = await fleet.last_order()
        await expect(form).to_contain_text(f"Order {name} created")
        robot = page.locator("nena-robot-page")
        await expect(robot.locator(".chip")).to_have_text("Busy")
        await expect(robot.locator("nena-why-list")).to_contain_text(f"Order {name}, state")
        await expect(button(page, "Resume")).to_be_hidden()
        await button(page, "Cancel order …").click()
        asked = page.get_by_role("form", name="Cancel order")
        await expect(asked).to_contain_text(f"The robot stops, and order {name} ends as withdrawn.")
        await button(page, f"Withdraw {name} now").click()
        await expect(robot).to_contain_text(f"Order {name} withdrawn")
        await order_in(fleet.orders, name, "FAILED")
        await expect(robot.locator(".chip")).to_have_text("Idle")
        await expect(button(page, "Cancel order …")).to_be_disabled()


async def test_dispatch_to_a_coordinate_typed_and_on_the_map(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path) as fleet,
        opened(browser, fleet.url + ROBOT) as page,
    ):
        await button(page, "Dispatch …").click()
        form = page.get_by_role("form", name="Dispatch")
        await form.locator("select[name=kind]").select_option("coordinate")
        await form.get_by_label("x in m").fill("6.5")
        await form.get_by_label("y in m").fill("3")
        await form.get_by_label("Heading").fill("90")
        await button(page, "Dispatch").click()
        await fleet.robot_at(6.5, 3)
        await order_in(fleet.orders, await fleet.last_order(), "FINISHED")
        assert (await fleet.robot())["theta"] == pytest.approx(pi / 2, abs=0.2)

        await button(page, "Pick on map").click()
        await expect(page.get_by_text("Click a position on the map")).to_be_visible()
        await drag_heading(page, 9, 7, turned_to=pi)
        await expect(form.get_by_label("Heading")).to_have_value(re.compile("^-?180$"))
        await picture(page, "dispatch-to-coordinate")
        await button(page, "Dispatch").click()
        at = await fleet.robot_at(9, 7)
        await order_in(fleet.orders, await fleet.last_order(), "FINISHED")
        at = await fleet.robot()
        assert abs(at["theta"]) == pytest.approx(pi, abs=0.2)


async def drag_heading(page: Page, x: float, y: float, *, turned_to: float) -> None:
    """Click a position on the map, and drag to the left or right."""
    await plan_shown(page)
    box = await page.locator("nena-fleet-map canvas").bounding_box()
    assert box is not None
    px, py = await page.evaluate(f"document.querySelector('nena-fleet-map').view.toScreen({x}, {y})")
    await page.mouse.move(box["x"] + px, box["y"] + py)
    await page.mouse.down()
    await page.mouse.move(box["x"] + px + (60 if turned_to == 0 else -60), box["y"] + py, steps=4)
    await page.mouse.up()


async def test_a_robot_is_sent_to_charge(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path) as fleet,
        opened(browser, fleet.url + ROBOT) as page,
    ):
        await button(page, "Charge now").click()
        told = page.locator("nena-robot-commands > .result")
        await expect(told).to_contain_text("Robot-01 → Charging station")
        # This robot has no such action. That others charge is tested with the order service.
        order = await order_in(fleet.orders, await fleet.last_order(), "FAILED")
        assert (order["type"], order["intendedVehicle"]) == ("Charge", "Robot-01")
        assert order["driveOrders"][0]["destination"]["operation"] == "Charge"


async def test_the_initial_position_is_set(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path) as fleet,
        opened(browser, fleet.url + ROBOT) as page,
    ):
        await button(page, "Set position …").click()
        form = page.get_by_role("form", name="Set position")
        await expect(form.get_by_label("x in m")).to_have_value("3.00")
        await button(page, "Pick on map").click()
        await page.keyboard.press("Escape")
        await expect(page.get_by_text("Click a position on the map")).to_be_hidden()
        await button(page, "Pick on map").click()
        await drag_heading(page, 15, 2, turned_to=0)
        await button(page, "Set position").click()
        await expect(form).to_contain_text("Position of Robot-01 set")
        await fleet.robot_at(15, 2)
        await expect(page.locator("nena-robot-page .facts")).to_contain_text(re.compile(r"x (14\.9|15\.0)"))


async def test_late_position_is_filled_in_unless_one_was_typed(hall: Hall, browser: Browser) -> None:
    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.send(Topic.STATE, state(1, at=seconds_now(), mobile_robot_position=None))
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status("r1"), vehicle, retain=True)
        async with opened(browser, f"{hall.url}#/robots/ACME%2Fr1", expected=("502",)) as page:
            await button(page, "Set position …").click()
            x = page.get_by_role("form", name="Set position").get_by_label("x in m")
            await expect(x).to_have_value("")
            hall.send(Topic.STATE, state(2, at=seconds_now(), mobile_robot_position=position(4, 2)))
            await expect(x).to_have_value("4.00")
            await x.fill("7")
            hall.send(Topic.STATE, state(3, at=seconds_now(), mobile_robot_position=position(5, 2)))
            await expect(page.locator("nena-robot-page .facts")).to_contain_text("x 5.0")
            await expect(x).to_have_value("7")


async def test_commands_to_places_wait_for_the_plan(hall: Hall, browser: Browser) -> None:
    come = asyncio.Event()

    async def late(route: Route) -> None:
        await come.wait()
        await route.continue_()

    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.publish_plant()
        hall.send(Topic.STATE, state(at=seconds_now()))
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status("r1"), vehicle, retain=True)
        async with opened(browser, f"{hall.url}#/robots/ACME%2Fr1", expected=("502",)) as page:
            await page.route("**/api/v1/plant", late)
            await page.reload()
            await expect(button(page, "Pause")).to_be_visible()
            await expect(button(page, "Charge now")).to_be_disabled()
            await expect(button(page, "Dispatch …")).to_be_disabled()
            come.set()
            await button(page, "Dispatch …").click()
            await page.get_by_role("form", name="Dispatch").get_by_label("Place").select_option("South 3")


async def test_pause_resume_and_an_action_of_the_factsheet(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path, speed=SLOW) as fleet,
        opened(browser, fleet.url + ROBOT, expected=REFUSALS) as page,
    ):
        robot = page.locator("nena-robot-page")
        await button(page, "Dispatch …").click()
        form = page.get_by_role("form", name="Dispatch")
        await form.get_by_label("Place").select_option("South 3")
        await button(page, "Dispatch").click()
        await expect(robot.locator(".chip")).to_have_text("Busy")
        await button(page, "Pause").click()
        await expect(robot).to_contain_text("Robot-01 paused")
        await expect(robot.locator(".chip")).to_have_text("Blocked")
        await expect(robot.locator("nena-why-list")).to_contain_text("Use Resume")
        await expect(button(page, "Pause")).to_be_hidden()
        await expect(button(page, "Resume")).to_be_focused()
        await picture(page, "why-it-stands")
        await page.locator("nena-attention-button button").click()
        matter = page.locator("nena-attention li").filter(has_text="Robot-01")
        await matter.get_by_role("button", name="Resume").click()
        await expect(robot.locator(".chip")).to_have_text("Busy")
        await expect(matter).to_have_count(0)
        await button(page, "Instant action …").click()
        action = page.get_by_role("form", name="Instant action")
        await action.get_by_label("Action").select_option("stateRequest")
        await button(page, "Start action").click()
        await expect(action).to_contain_text("stateRequest finished on Robot-01")
        await form.wait_for(state="detached")


async def test_a_waiting_order_is_changed_and_a_finished_one_repeated(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with operated(broker, interface_name, tmp_path, speed=SLOW) as fleet:
        body = {"destinations": [{"locationName": "Storage", "operation": "Load cargo"}]}
        first = {
            **body,
            "name": "T-1",
            "intendedVehicle": "Robot-01",
            "onFailure": [{"do": "RETRY", "times": 2}],
            "deadline": "2026-01-01T08:00:00Z",
        }
        more = {"dependencies": ["T-1"], "properties": [{"key": "pallet", "value": "4711"}]}
        for order in (first, {**body, **more, "name": "T-2"}):
            assert (await fleet.orders.post("/v1/transportOrders", json=order)).status_code == 201
        async with opened(browser, f"{fleet.url}#/orders/T-2") as page:
            shown = page.locator("nena-order-page")
            await expect(shown.locator(".chip")).to_have_text("Waits for orders")
            await expect(shown).to_contain_text("pallet: 4711")
            await button(page, "Change").click()
            form = page.get_by_role("form", name="Change order T-2")
            await form.get_by_label("Priority").fill("7")
            await form.get_by_label("Time limit").fill("30")
            await button(page, "Save").click()
            await expect(form).to_contain_text("Order T-2 changed")
            changed = (await fleet.orders.get("/v1/transportOrders/T-2")).json()
            assert (changed["priority"], changed["timeout"]) == (7, 1800)
            assert await findings(page) == []
            await picture(page, "change-order")
            await shown.get_by_role("link", name="T-1").click()
            await expect(shown).to_contain_text(re.compile("try again . 2"))
            await expect(shown.get_by_role("link", name="T-2")).to_be_visible()
            await button(page, "Withdraw").click()
            await expect(button(page, "Finish the drive, then stop")).to_be_visible()
            await button(page, "Repeat").click()
            await expect(shown).to_contain_text("created")
            await page.get_by_role("link", name="Open it").click()
            await expect(shown.locator("h2")).to_have_text(re.compile("^T-1-[0-9a-f]{22}$"))
            name = await fleet.last_order()
            again = (await fleet.orders.get(f"/v1/transportOrders/{name}")).json()
            assert [each["destination"]["operation"] for each in again["driveOrders"]] == ["Load cargo"]
            assert again["intendedVehicle"] == "Robot-01"
            assert again["deadline"] is None, "it is over"
            await button(page, "Repeat, edit first").click()
            form = page.get_by_role("form", name="New transport order")
            await expect(form.get_by_label("Place")).to_have_value("Storage")
            await expect(form.get_by_label("Name")).to_have_value("T-1")
            await button(page, "Create order").click()
            await expect(shown.locator("h2")).to_have_text(re.compile("^T-1-"))


async def test_several_orders_are_prioritised_repeated_and_withdrawn(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with operated(broker, interface_name, tmp_path) as fleet:
        for name in ("WMS-1", "WMS-2", "WMS-3"):  # Robot-02 has never connected
            stop = {"locationName": "Goods in", "operation": "Load cargo"}
            body = {"name": name, "intendedVehicle": "Robot-02", "destinations": [stop]}
            assert (await fleet.orders.post("/v1/transportOrders", json=body)).status_code == 201

        async def listed() -> list[tuple[str, int, str]]:
            found = (await fleet.orders.get("/v1/transportOrders")).json()["transportOrders"]
            return sorted((each["name"][:5], each["priority"], each["outcome"] or "") for each in found)

        async with opened(browser, fleet.url) as page:
            await page.get_by_role("tab", name="Orders").click()

            async def mark() -> None:
                for name in ("WMS-1", "WMS-2"):
                    await page.get_by_role("checkbox", name=f"Select {name}", exact=True).check()

            result, bar = page.locator("nena-several-orders .result"), page.locator("nena-several-orders")
            await mark()
            await expect(bar).to_contain_text("2 orders selected")
            await bar.get_by_label("Priority").fill("7")
            await picture(page, "several-orders")
            assert await findings(page) == []
            await button(page, "Set priority").click()
            await expect(result).to_have_text("Priority of 2 of 2 orders set")
            assert await listed() == [("WMS-1", 7, ""), ("WMS-2", 7, ""), ("WMS-3", 0, "")]
            await mark()
            await bar.get_by_role("button", name="Repeat").click()
            await expect(result).to_have_text("2 of 2 orders repeated")
            assert [each[:2] for each in await listed()] == [
                *[("WMS-1", 7)] * 2,
                *[("WMS-2", 7)] * 2,
                ("WMS-3", 0),
            ]
            await mark()
            await button(page, "Withdraw …").click()
            await button(page, "Withdraw 2 orders at once").click()
            await expect(result).to_have_text("2 of 2 orders withdrawn")
            assert [each[2] for each in await listed()] == ["", "WITHDRAWN", "", "WITHDRAWN", ""]
            await expect(page.get_by_role("button", name="Withdrawn 2")).to_be_visible()
            await expect(page.locator("nena-attention-button")).not_to_contain_text("WMS")


async def test_withdrawal_is_confirmed_and_a_refusal_shown(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with operated(broker, interface_name, tmp_path, speed=SLOW) as fleet:
        body = {"name": "T-1", "destinations": [{"locationName": "Storage", "operation": "Load cargo"}]}
        assert (await fleet.orders.post("/v1/transportOrders", json=body)).status_code == 201
        async with opened(browser, f"{fleet.url}#/orders/T-1", expected=REFUSALS) as page:
            await expect(page.locator("nena-order-page .chip")).to_have_text("In progress")
            sure = button(page, "Stop at once")
            await expect(sure).to_be_hidden()
            await button(page, "Withdraw").click()
            effect = page.get_by_text("Robot-01 stops, and order T-1 ends as withdrawn.")
            await expect(effect).to_be_focused()  # not the button: a held Enter key would press it
            await sure.click()
            await expect(page.locator("nena-order-page")).to_contain_text("Order T-1 withdrawn")
            await order_in(fleet.orders, "T-1", "FAILED")
            await expect(page.locator("nena-order-page .chip")).to_have_text("Withdrawn")
            await page.get_by_role("link", name="All robots and orders").click()
            await page.get_by_role("link", name="New order").click()
            form = page.get_by_role("form", name="New transport order")
            await form.get_by_label("Place").select_option("Parking bay")
            await form.get_by_label("Name").fill("T-1")
            await button(page, "Create order").click()
            await expect(form).to_contain_text("Refused:")
            await expect(form).to_contain_text("T-1")


async def test_order_is_held_and_resumed(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with operated(broker, interface_name, tmp_path, speed=SLOW) as fleet:
        body = {"name": "T-1", "destinations": [{"locationName": "Storage", "operation": "Load cargo"}]}
        assert (await fleet.orders.post("/v1/transportOrders", json=body)).status_code == 201
        async with opened(browser, f"{fleet.url}#/orders/T-1") as page:
            shown, why = page.locator("nena-order-page"), page.locator("nena-order-page nena-why-list")
            chip, hold, resume = shown.locator(".chip"), button(page, "Hold"), button(page, "Resume")
            await expect(chip).to_have_text("In progress")
            await expect(resume).to_be_hidden()
            await page.evaluate("localStorage.setItem('nena-person', 'Kim')")  # as entered for a stop before
            await hold.click()
            await expect(shown).to_contain_text("Order T-1 put on hold")
            await expect(why).to_contain_text("Kim")
            await expect(chip).to_have_text("On hold")
            await expect(hold).to_be_hidden()
            await expect(why).to_contain_text("held at the control panel")
            await expect(why).to_contain_text("Use Resume")
            await expect(shown.locator(".history")).to_contain_text("Put on hold")
            assert await findings(page) == []
            await picture(page, "held-order")
            await page.get_by_role("link", name="All robots and orders").click()
            robot = page.locator("tr[data-robot]").filter(has_text="Robot-01")
            await expect(robot.locator(".chip")).to_have_text("Waiting")
            await expect(robot).to_contain_text("held at the control panel")
            await page.get_by_role("tab", name="Orders").click()
            await button(page, "On hold 1").click()
            row = page.locator("tr[data-order='T-1']")
            await expect(row).to_contain_text("On hold")
            await row.get_by_role("link").click()
            await resume.click()
            await expect(shown).to_contain_text("Order T-1 resumed")
            await expect(chip).to_have_text("In progress")
            await expect(resume).to_be_hidden()


async def test_reasons_of_the_order_service_are_in_the_language_of_the_panel(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        operated(broker, interface_name, tmp_path, speed=SLOW) as fleet,
        opened(browser, fleet.url, language="de-DE") as page,
    ):
        shown = page.locator("nena-order-page")

        async def is_in_german(name: str, *words: str) -> None:
            await visit(page, f"{fleet.url}#/orders/{name}")
            for each in words:
                await expect(shown).to_contain_text(each)
            await expect(shown.locator("[lang=en]", has_text=re.compile(r"\S"))).to_have_count(0)
            reason = (await fleet.orders.get(f"/v1/transportOrders/{name}")).json()["reason"]
            assert reason
            assert reason not in await shown.inner_text()

        for name in ("first", "second"):
            stop = {"locationName": "Storage"}
            answer = await fleet.orders.post(
                "/v1/transportOrders", json={"name": name, "destinations": [stop]}
            )
            assert answer.status_code == 201
        await is_in_german("first", "Roboter Robot-01 fährt zum Ziel 1 von 1", "einziger freier Roboter")
        await is_in_german("second", "jeder davon: nie verbunden oder führt einen anderen Auftrag aus")
        await button(page, "Anhalten").click()
        await is_in_german("second", "am Leitstand angehalten")
        await picture(page, "held-order-german")
        await button(page, "Zurückziehen").click()
        await button(page, "second jetzt zurückziehen").click()
        await is_in_german("second", "Fehlgeschlagen · am Leitstand zurückgezogen")

        async def recorded() -> str:
            async with httpx.AsyncClient(base_url=fleet.url, timeout=PATIENCE) as panel:
                return (await panel.get("/api/v1/history?order=second")).text

        await awaited(recorded, lambda text: '"FAILED"' in text, what="the withdrawal is in the history")
        await visit(page, f"{fleet.url}#/history")
        log = page.locator("nena-history-page")
        await expect(log).to_contain_text("Zurückgezogen: am Leitstand zurückgezogen")
        await expect(log).not_to_contain_text("works on another order")


async def test_panel_is_read_only_without_an_order_service(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    fleet = Fleet(broker, interface_name, tmp_path)
    with fleet.stack:
        fleet.agent()
        port = free_port()
        options = [
            "--http.port",
            str(port),
            "--mqtt.port",
            str(broker.port),
            "--interface_name",
            interface_name,
        ]
        with AggregatorProcess(*options):
            async with opened(browser, "about:blank") as page:
                await reach(page, f"http://127.0.0.1:{port}/{ROBOT}")
                await expect(button(page, "Pause")).to_be_hidden()
                await expect(page.get_by_text("This page only shows")).to_be_visible()


async def reach(page: Page, url: str) -> None:
    """Open a page as soon as it is served."""

    async def look() -> bool:
        async with httpx.AsyncClient(timeout=PATIENCE) as client:
            try:
                return (await client.get(url.split("#", maxsplit=1)[0])).is_success
            except httpx.TransportError:
                return False

    await awaited(look, bool, seconds=PATIENCE, what=f"{url} is served")
    await page.goto(url)


async def test_a_person_may_have_the_name_of_a_property(hall: Hall, browser: Browser) -> None:
    """The names of holders are looked up by name."""
    async with hall.connected(), opened(browser, hall.url) as page:
        names = ["constructor", "toString", "__proto__"]
        found = await page.evaluate(
            "(names) => import('./reasons.js').then((module) => names.map(module.nameOfHolder))", names
        )
        assert found == names
