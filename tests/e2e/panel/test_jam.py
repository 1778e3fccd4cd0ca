"""A jam in a real browser: the queue up to its head, and an order service that stops."""

from __future__ import annotations

import re
import signal
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.fleet_examples import (
    START,
    connection,
    drive_order,
    position,
    state,
    vehicle_status,
    way,
)
from support.order_service_fleet import Fleet, listening, order_in, vehicle_idle
from support.panel import (
    COLOUR_NEAR,
    LABELS,
    OVERLAPPING,
    Hall,
    becomes,
    findings,
    fits,
    opened,
    picture,
    seconds_now,
    visit,
)

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

STOP = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}
ROBOTS = 50
JAM = ("--jam.robots", "3", "--jam.seconds", "0.1")


def robot(hall: Hall, number: int, x: float, y: float, *behind: int, **fields: Any) -> None:
    """Publish a stationary robot and its vehicle; one ``behind`` others has the order T-number."""
    key, name = RobotKey("ACME", f"r{number:02}"), f"AMR-{number:02}"
    hall.send(Topic.CONNECTION, connection(robot=key), robot=key, retain=True)
    shown = {"mobile_robot_position": position(x, y), "last_node_id": "Middle 2", **fields}
    hall.send(Topic.STATE, state(robot=key, at=seconds_now(), **shown), robot=key)
    wait = None
    if behind:
        names = tuple(f"AMR-{each:02}" for each in behind)
        reason = f"it waits for {names[0]}, which passes 'Middle 2' first"
        wait = TrafficWait(vehicles=names, at="Middle 2", cause=WaitCause.PASSES, reason=reason)
        hall.publish_order(
            1,
            TransportOrderState.BEING_PROCESSED,
            f"T-{number}",
            processing_vehicle=name,
            reason=f"Vehicle {name} travels to destination 2 of 2, but {reason}",
            drive_orders=(
                drive_order("Goods in", "Load", DriveOrderState.FINISHED, ("A", "B")),
                drive_order("Packing", "Unload", DriveOrderState.TRAVELLING, ("B", "C")),
            ),
            current_drive_order_index=1,
        )
    status = vehicle_status(name, robot=key, transport_order=f"T-{number}" if behind else None, wait=wait)
    body = status.model_dump_json(by_alias=True)
    hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), body, retain=True)


def jam(hall: Hall) -> None:
    """Let robots stand in a queue behind AMR-17, which has an emergency stop, and others work."""
    hall.publish_plant()
    robot(hall, 17, 12, 7, **STOP)
    robot(hall, 15, 9, 7, 17, order_id="vda-15", **way("Middle gate", released=0))
    robot(hall, 1, 7.5, 7, 15)
    robot(hall, 2, 6, 7, 1)
    robot(hall, 3, 4.5, 7, 2)
    robot(hall, 4, 3, 7, 3)
    robot(hall, 5, 15, 12)
    robot(hall, 6, 21, 2, paused=True)
    robot(hall, 7, 9, 12, driving=True, order_id="vda-7", **way("North 1", "Middle 1"))


def row(page: Page, number: int) -> Any:
    return page.locator(f"tr[data-robot='ACME/r{number:02}']")


@pytest.mark.parametrize("dark", [False, pytest.param(True, marks=pytest.mark.long)], ids=["light", "dark"])
async def test_jam_is_traced_to_its_first_robot(hall: Hall, browser: Browser, *, dark: bool) -> None:
    async with hall.connected(*JAM):
        jam(hall)
        async with opened(browser, hall.url, width=1600, height=1000, dark=dark) as page:
            header = page.locator("nena-fleet-summary")
            needs = page.locator("nena-attention-button")
            await expect(needs).to_contain_text("Emergency stop: AMR-17")
            jammed = page.locator("nena-attention li").filter(has_text="Jam")
            await expect(jammed).to_contain_text("holds up 5 robots")
            await expect(header).to_contain_text("5 Waiting")
            await expect(header).to_contain_text("1 Idle")
            await expect(page.locator("tr[data-robot]").first).to_contain_text("AMR-17")
            await expect(row(page, 17)).to_contain_text("Emergency stop")
            waiting = row(page, 1)
            await expect(waiting).to_contain_text("Waits for AMR-15 to pass Middle 2.")
            await expect(waiting).to_contain_text("AMR-17 (Emergency stop) is at the head")
            await expect(waiting.locator(".order")).to_have_text("T-1")
            await expect(waiting.get_by_role("progressbar")).to_have_attribute("value", "50")
            await becomes(page, LABELS, None, lambda labels: "AMR-17 (jam: 5)" in labels)
            await becomes(page, COLOUR_NEAR, [12, 7, "error"], lambda found: found > 20)
            await becomes(page, COLOUR_NEAR, [7.5, 7, "waiting"], lambda found: found > 20)
            await becomes(page, COLOUR_NEAR, [21, 2, "blocked"], lambda found: found > 20)
            assert await page.evaluate(OVERLAPPING) == []
            await picture(page, "dark" if dark else "jam")
            assert await findings(page) == []
            await waiting.get_by_role("link", name="AMR-01").click()
            causes = page.locator("nena-robot-page .causes li")
            await expect(causes.nth(0)).to_contain_text(re.compile("^Waits for AMR-15 to pass Middle 2."))
            await expect(causes.nth(1)).to_contain_text("AMR-15: Waits for AMR-17")
            await expect(causes.nth(2)).to_contain_text("AMR-17 (Emergency stop): Emergency stop active")
            await expect(causes.nth(3)).to_contain_text("T-1")
            if not dark:
                await picture(page, "queue")
            assert await findings(page) == []
            await causes.nth(2).get_by_role("link").click()
            await expect(page.locator("nena-robot-page h2")).to_have_text("AMR-17")
            behind = page.locator("nena-queue")
            await expect(behind).to_contain_text("5 robots wait behind it")
            await expect(behind.get_by_role("link", name="T-4")).to_be_visible()
            await expect(behind).to_contain_text("the others then continue.")
            assert await findings(page) == []
            await behind.get_by_role("link", name="AMR-04").click()
            await expect(page.locator("nena-robot-page h2")).to_have_text("AMR-04")
            await expect(behind).to_be_hidden()


async def test_a_circle_is_named(hall: Hall, browser: Browser) -> None:
    async with hall.connected("--jam.robots", "2", "--jam.seconds", "0.1"):
        hall.publish_plant()
        for number, other in ((1, 2), (2, 3), (3, 1)):
            robot(hall, number, 3.0 * number, 7, other)
        async with opened(browser, hall.url) as page:
            needs = page.locator("nena-attention-button")
            await expect(needs).to_contain_text("Robots wait for each other: AMR-01, AMR-02, AMR-03")
            await expect(row(page, 2)).to_contain_text("Waiting in a circle: AMR-01, AMR-02, AMR-03")
            await row(page, 2).get_by_role("link", name="AMR-02").click()
            causes = page.locator("nena-robot-page .causes")
            await expect(causes).to_contain_text("AMR-03: Waits for AMR-01")
            await expect(causes).to_contain_text("These robots wait for each other in a circle")
            robot(hall, 1, 3.0, 7)
            await expect(needs).not_to_contain_text("each other")


async def test_a_locked_path_is_the_head_of_those_that_wait_for_it(hall: Hall, browser: Browser) -> None:
    path = "South 1 --- South 2"
    async with hall.connected(*JAM):
        hall.publish_plant()
        for number in range(1, 5):
            robot(hall, number, 3.0 * number, 7)
            key, wait = (
                RobotKey("ACME", f"r{number:02}"),
                TrafficWait(at=path, cause=WaitCause.LOCKED, reason="it waits"),
            )
            status = vehicle_status(f"AMR-{number:02}", robot=key, transport_order=f"T-{number}", wait=wait)
            body = status.model_dump_json(by_alias=True)
            hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), body, retain=True)
        robot(hall, 5, 15, 7, 4)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await page.locator("nena-attention-button button").click()
            jammed = page.locator("nena-attention li").filter(has_text="Jam")
            await expect(jammed).to_contain_text("holds up 5 robots")
            await expect(jammed.get_by_role("link", name=path)).to_be_visible()
            await expect(row(page, 1)).to_contain_text(f"Waits until path {path} is unlocked.")
            await row(page, 5).get_by_role("link", name=f"Path {path} is locked").click()
            await expect(page.locator("nena-place-page h2")).to_have_text(path)
            await expect(page.locator("nena-queue")).to_contain_text("5 robots wait behind it")
            await expect(page.locator("nena-queue")).to_contain_text(
                "They continue once the path is unlocked."
            )
            assert await findings(page) == []


async def test_a_jam_is_ended_from_the_page_of_its_head(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    """The robots and the order service are real: Robot-02 is paused on the only destination of T-1."""
    fleet, port = Fleet(broker, interface_name, tmp_path), free_port()
    options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
    with fleet.stack:
        fleet.agent()
        fleet.agent("robot-02", x=15.0, y=2.0)
        async with await fleet.order_service().client() as orders:
            for name in ("Robot-01", "Robot-02"):
                await vehicle_idle(orders, name)
            await orders.post("/v1/vehicles/Robot-02/instantActions", json={"actionType": "pause"})
            to = {"destinations": [{"locationName": "South 3"}], "intendedVehicle": "Robot-01", "name": "T-1"}
            await orders.post("/v1/transportOrders", json=to)
            reached = ("--http.port", str(port), "--mqtt.port", str(broker.port))
            commands = ("--order_service.url", str(orders.base_url))
            with AggregatorProcess(*reached, *options, *commands) as aggregator:
                await aggregator.logged("broker connected")
                url = f"http://127.0.0.1:{port}/#/robots/NeNa%2Frobot-02"
                async with opened(browser, url, width=1600, height=1000) as page:
                    await end_the_jam(page, orders)


async def end_the_jam(page: Page, orders: httpx.AsyncClient) -> None:
    """Use each button of the queue behind Robot-02, and look at what a lock would close off."""
    behind = page.locator("nena-queue")
    await expect(behind).to_contain_text("1 robot waits behind it")
    await behind.get_by_role("button", name="Reroute the others").click()
    await expect(behind).to_contain_text("No robot has another route now.")
    await expect(behind.locator(".result")).to_have_attribute("data-level", "bad")
    await behind.get_by_role("button", name="Take out of traffic").click()
    form = page.get_by_role("form", name="In or out of use")
    await expect(form.locator("select")).to_have_value("TO_BE_IGNORED")
    await behind.get_by_role("button", name="Lock and lead around").click()
    asked = behind.get_by_role("form", name="Lock and lead around")
    await expect(asked).to_contain_text("1 robot and 1 order have no other route")
    await expect(asked).to_contain_text("Robot-01, T-1")
    assert await findings(page) == []
    await picture(page, "end-jam")
    only = "South 2 --- South 3"
    await orders.put(f"/v1/paths/{only}/lock", json={"locked": True})
    await expect(asked).not_to_contain_text(only)  # it shows what is there now
    await orders.put(f"/v1/paths/{only}/lock", json={"locked": False})
    await expect(asked).to_contain_text(only)
    await page.evaluate("localStorage.setItem('nena-person', 'Anna')")
    await asked.get_by_role("button", name="Lock these paths").click()
    await expect(asked).to_contain_text("Robots are led around Robot-02.")
    await expect(asked.get_by_role("button", name="Lock these paths")).to_be_disabled()
    paths = (await orders.get("/v1/paths", params={"locked": "true"})).json()["paths"]
    assert paths
    assert all("South 3" in (path["destinationPoint"], path["sourcePoint"]) for path in paths)
    assert {path["lockedBy"]["by"] for path in paths} == {"Anna"}
    await page.locator("nena-attention-button button").click()
    entry = page.locator("nena-attention li").filter(has_text=f"{len(paths)} paths locked")
    await expect(entry).to_contain_text("by Anna since")
    for width in (1600, 1280, 390):
        await page.set_viewport_size({"width": width, "height": 1000})
        await picture(page, f"locked-together-{width}")
    await page.set_viewport_size({"width": 1600, "height": 1000})
    await entry.get_by_role("button", name="Unlock all").click()
    await expect(entry).to_have_count(0)
    assert (await orders.get("/v1/paths", params={"locked": "true"})).json()["paths"] == []
    await page.locator("nena-attention-button button").click()
    for path in paths:  # the one that is looked at is the only way there then
        await orders.put(f"/v1/paths/{path['name']}/lock", json={"locked": path["name"] != only})
    await visit(page, f"{page.url.partition('#')[0]}#/places/South%202%20---%20South%203")
    place = page.locator("nena-place-page")
    await expect(place.locator(".chip")).to_have_text("Path")
    await place.get_by_role("button", name="Lock", exact=True).click()
    await expect(place).to_contain_text("1 robot and 1 order have no other route")
    assert not (await orders.get("/v1/paths/South 2 --- South 3")).json()["locked"]
    await orders.post("/v1/transportOrders/T-1/withdrawal")
    await expect(place).to_contain_text("All orders have another route.")
    await place.get_by_role("button", name="Lock anyway").click()
    await expect(place.locator(".chip")).to_have_text("Path, locked")
    await expect(place.locator(".head")).to_contain_text("by Anna since")


async def test_an_idle_robot_shows_no_old_goals_and_no_internal_orders(hall: Hall, browser: Browser) -> None:
    goals = tuple(
        {
            "info_type": "goal",
            "info_level": "INFO",
            "info_references": (
                {"reference_key": "goalId", "reference_value": str(number)},
                {"reference_key": "status", "reference_value": status},
            ),
        }
        for number, status in enumerate(("ABORTED", "ABORTED", "SUCCEEDED"))
    )
    async with hall.connected():
        hall.publish_plant()
        robot(hall, 1, 3, 7, order_id="evasion-7f37e9cd", information=goals)
        robot(hall, 2, 9, 7, order_id="vda-2", information=goals, **way("Middle 3"))
        async with opened(browser, hall.url) as page:
            await expect(row(page, 1)).to_contain_text("Idle")
            await row(page, 1).get_by_role("link").click()
            shown = page.locator("nena-robot-page")
            await expect(shown).to_contain_text("Localised")
            for text in ("evasion-", "100 %", "aborted", "Navigation goals"):
                await expect(shown.locator(f"section:visible:has-text('{text}')")).to_have_count(0)
            await visit(page, hall.url + "#/robots/ACME%2Fr02")
            await expect(shown.get_by_role("heading", name="Navigation goals")).to_be_visible()


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)])
async def test_emergency_stop_among_many_robots_is_visible_at_once(
    hall: Hall, browser: Browser, width: int, height: int
) -> None:
    async with hall.connected():
        hall.publish_plant()
        for number in range(1, ROBOTS + 1):
            stop = STOP if number == ROBOTS else {}
            robot(hall, number, 9 + number % 8, 6 + number // 8 / 2, **stop)
        async with opened(browser, hall.url, width=width, height=height) as page:
            await expect(page.get_by_role("tab", name="Robots")).to_have_text(f"Robots ({ROBOTS})")
            wide = page.get_by_role("button", name=f"Emergency stop: AMR-{ROBOTS}")
            narrow = page.locator("nena-attention").get_by_role("link", name=f"AMR-{ROBOTS}")
            await expect(wide if width > 900 else narrow).to_be_in_viewport()
            await expect(page.locator("tr[data-robot]").first).to_contain_text(f"AMR-{ROBOTS}")
            if width <= 900:
                await page.get_by_role("tab", name="Map").click()
            await becomes(page, LABELS, None, lambda labels: f"AMR-{ROBOTS}" in labels)
            labels = await page.evaluate(LABELS)
            assert await page.evaluate(OVERLAPPING) == []
            await page.locator("nena-fleet-map canvas").focus()
            for _ in range(6):
                await page.keyboard.press("+")
                await becomes(page, OVERLAPPING, None, lambda pairs: pairs == [])
            await becomes(page, LABELS, None, lambda shown: set(shown) != set(labels))


async def test_red_banner_for_a_stopped_or_hanging_order_service(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    fleet, port = Fleet(broker, interface_name, tmp_path), free_port()
    options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
    with (
        fleet.stack,
        AggregatorProcess("--http.port", str(port), "--mqtt.port", str(broker.port), *options) as aggregator,
    ):
        await aggregator.logged("broker connected")
        service = fleet.order_service()
        async with await service.client() as orders:
            await listening(orders)
        async with opened(browser, f"http://127.0.0.1:{port}/") as page:
            banner = page.locator("nena-link-banner")
            up = "document.querySelector('nena-fleet-map').store?.orderService.up"
            await becomes(page, up, None, lambda found: found is True)
            await expect(banner).to_be_hidden()
            service.kill()
            await expect(banner).to_contain_text("The order service is down (last heartbeat:")
            await expect(banner).to_have_attribute("data-level", "bad")
            await expect(page.locator("body")).to_have_class("orders-old")
            service = fleet.order_service(name="second")
            await expect(banner).to_be_hidden()
            await expect(page.locator("body")).not_to_have_class("orders-old")
            service.process.send_signal(signal.SIGSTOP)  # it hangs: its connection stays, its heartbeat stops
            await expect(banner).to_contain_text("The order service is down (last heartbeat:")
            service.kill()


async def test_robot_waiting_for_a_paused_one_is_not_idle(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    """The robots and the order service are real: Robot-01 is assigned to an order and has none yet."""
    fleet, port = Fleet(broker, interface_name, tmp_path), free_port()
    options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
    addresses = ("--http.port", str(port), "--mqtt.port", str(broker.port))
    with fleet.stack, AggregatorProcess(*addresses, *options) as aggregator:
        await aggregator.logged("broker connected")
        fleet.agent()
        fleet.agent("robot-02", x=15.0, y=2.0)
        service = fleet.order_service()
        async with await service.client() as orders, opened(browser, f"http://127.0.0.1:{port}/") as page:
            for name in ("Robot-01", "Robot-02"):
                await vehicle_idle(orders, name)
            await orders.post("/v1/vehicles/Robot-02/instantActions", json={"actionType": "pause"})
            to = {"destinations": [{"locationName": "South 3"}], "intendedVehicle": "Robot-01", "name": "T-1"}
            await orders.post("/v1/transportOrders", json=to)
            waiting = page.locator("tr[data-robot='NeNa/robot-01']")
            await expect(waiting).to_have_attribute("data-condition", "WAITING")
            await expect(waiting).to_contain_text("Blocked at South 3 by Robot-02.")
            await expect(
                waiting.get_by_role("link", name="Robot-02 (Blocked) is at the head")
            ).to_be_visible()
            await expect(waiting.locator(".order")).to_have_text("T-1")
            await orders.post("/v1/vehicles/Robot-02/instantActions", json={"actionType": "resume"})
            await order_in(orders, "T-1", "FINISHED")
            await expect(waiting).to_have_attribute("data-condition", "IDLE")
            await expect(waiting).not_to_contain_text("at the head")


async def test_reasons_of_a_stopped_order_service_are_marked_as_outdated(
    hall: Hall, browser: Browser
) -> None:
    async with hall.connected():
        jam(hall)
        dead = ServiceStatus(online=False, timestamp=START, store_ready=False)
        hall.peer.publish(hall.fleet.service_status, dead.model_dump_json(by_alias=True), retain=True)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await expect(page.locator("nena-link-banner")).to_contain_text("The order service is down.")
            for part in (".reason", "a:has-text('at the head')", ".order", ".progress"):
                await expect(row(page, 1).locator(part)).to_have_css("font-style", "italic")
            await expect(row(page, 7).locator(".order")).to_have_css("font-style", "normal")
            await expect(row(page, 17).locator(".reason")).to_have_css("font-style", "normal")
            await expect(page.locator("tr[data-order='T-1'] .reason").first).to_have_css(
                "font-style", "italic"
            )
            assert await findings(page) == []
            await picture(page, "order-service-down")
            await visit(page, hall.url + "#/robots/ACME%2Fr01")
            causes = page.locator("nena-robot-page .causes")
            await expect(causes).to_contain_text(
                "The order service is down; its orders and reasons are out of date."
            )
            assert await findings(page) == []


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("de-DE", ("Stau", "hält auf: 5 Roboter", "Not-Halt", "Wartet", "AMR-17 (Not-Halt) steht ganz vorn")),
        (
            "nl-NL",
            ("Opstopping", "houdt op: 5 robots", "Noodstop", "Wacht", "AMR-17 (Noodstop) staat vooraan"),
        ),
    ],
)
async def test_jam_is_shown_in_the_users_language(
    hall: Hall, browser: Browser, language: str, words: tuple[str, ...]
) -> None:
    async with hall.connected(*JAM):
        jam(hall)
        async with opened(browser, hall.url, width=390, language=language) as page:
            jammed, holds, urgent, waiting, head = words
            matter = page.locator("nena-attention li").filter(has_text=jammed)
            await expect(matter).to_contain_text(holds)
            await expect(row(page, 17)).to_contain_text(urgent)
            await expect(row(page, 1)).to_contain_text(waiting)
            await expect(row(page, 1)).to_contain_text(head)
            await fits(page, 390)


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en-GB", "Order T-9: path A -- B is locked."),
        ("de-DE", "Wartet mit Auftrag T-9."),
        ("nl-NL", "Wacht met order T-9."),
    ],
)
async def test_reason_of_a_waiting_robot_is_in_one_language(
    hall: Hall, browser: Browser, language: str, words: str
) -> None:
    async with hall.connected():
        hall.publish_plant()
        robot(hall, 9, 3, 7)
        key, wait = RobotKey("ACME", "r09"), TrafficWait(reason="path A -- B is locked")
        status = vehicle_status("AMR-09", robot=key, transport_order="T-9", wait=wait)
        body = status.model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), body, retain=True)
        async with opened(browser, hall.url, language=language) as page:
            await expect(row(page, 9).locator(".reason")).to_have_text(words)
