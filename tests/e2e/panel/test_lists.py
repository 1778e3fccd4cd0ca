"""The lists beside the map: tabs, order, filters, search, commands to several robots, and a thousand rows."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.async_api import Browser, Page, Route, expect

from nena_shared.fleet_api.stops import SetBy
from nena_shared.fleet_api.transport_order import Hold, OrderOutcome, TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from support.broker import free_port
from support.fleet_examples import connection, position, power, state, vehicle_status
from support.panel import (
    LABELS,
    Hall,
    answered,
    becomes,
    findings,
    fits,
    opened,
    picture,
    plan_shown,
    seconds_now,
    visit,
)
from support.panel_texts import Texts

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

LANGUAGES = ("en-GB", "de-DE", "nl-NL")
STOP: dict[str, Any] = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}
MANY = 1000
USABLE_WITHIN = 1.0
"""Seconds of the page's own time from the list of many robots to the answer to a search."""


SEARCH_SECONDS = """(word) => new Promise((done) => {
  const input = document.querySelector("nena-search input");
  const begin = performance.now();
  input.value = word;
  input.dispatchEvent(new Event("input"));
  requestAnimationFrame(() => requestAnimationFrame(() => done((performance.now() - begin) / 1000)));
})"""
"""How long the page takes to show what is searched."""


def robot(
    hall: Hall, number: int, charge: float = 80.0, /, *, order: str | None = None, **fields: Any
) -> None:
    """Publish a robot and its vehicle, which is assigned to an order."""
    key = RobotKey("ACME", f"r{number:03}")
    hall.send(Topic.CONNECTION, connection(robot=key), robot=key, retain=True)
    here = position(3 + number % 20, 2 + number // 20 % 10)
    shown = {"mobile_robot_position": here, **power(charge), **fields}
    hall.send(Topic.STATE, state(robot=key, at=seconds_now(), **shown), robot=key)
    status = vehicle_status(f"AMR-{number:02}", robot=key, transport_order=order).model_dump_json(
        by_alias=True
    )
    hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), status, retain=True)


def shift(hall: Hall) -> None:
    """Publish a small fleet and its orders."""
    hall.publish_plant()
    robot(hall, 1, 30)
    robot(hall, 2, 90, paused=True)
    robot(hall, 3, 60, **STOP)
    robot(hall, 4, 50)
    hall.publish_order(1, TransportOrderState.BEING_PROCESSED, "WMS-041", processing_vehicle="AMR-04")
    hall.publish_order(1, TransportOrderState.FINISHED, "WMS-042", processing_vehicle="AMR-01")


async def listed(page: Page, *names: str) -> None:
    """Wait until the list shows these robots in this order."""
    await expect(page.locator("tr[data-robot] a.name")).to_have_text(names)


@pytest.mark.parametrize(
    ("width", "height", "dark"),
    [
        (1600, 1000, True),
        (1280, 800, False),
        pytest.param(1600, 1000, False, marks=pytest.mark.long),
        pytest.param(1280, 800, True, marks=pytest.mark.long),
    ],
)
async def test_sorting_and_filters_are_stored_in_the_address(
    hall: Hall, browser: Browser, width: int, height: int, *, dark: bool
) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url, width=width, height=height, dark=dark) as page:
            await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (4)")
            await expect(page.locator("tr[data-robot='ACME/r004'] .name")).to_have_text("AMR-04")
            await listed(page, "AMR-03", "AMR-02", "AMR-01", "AMR-04")
            battery = page.get_by_role("columnheader", name="Battery")
            await battery.get_by_role("button").click()
            await expect(battery).to_have_attribute("aria-sort", "ascending")
            await listed(page, "AMR-03", "AMR-01", "AMR-04", "AMR-02")  # the urgent one stays on top
            await battery.get_by_role("button").click()
            await listed(page, "AMR-03", "AMR-02", "AMR-04", "AMR-01")
            idle = page.get_by_role("button", name="2 Idle")
            await idle.click()
            await expect(idle).to_have_attribute("aria-pressed", "true")
            await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (2)")
            await listed(page, "AMR-04", "AMR-01")
            assert await findings(page) == []
            await page.reload()
            await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (2)")
            await listed(page, "AMR-04", "AMR-01")
            await page.get_by_role("link", name="AMR-01", exact=True).click()
            await page.get_by_role("link", name="All robots and orders").click()
            await expect(idle).to_have_attribute("aria-pressed", "true")
            await idle.click()
            await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (4)")
            for unknown in ("tab=constructor", "state=hasOwnProperty", "robotSort=hasOwnProperty"):
                await visit(page, f"{hall.url}#/?{unknown}")
                await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (4)")


async def test_rows_keep_their_order_while_the_pointer_is_over_them(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            last = page.locator("tr[data-robot='ACME/r004']")
            await listed(page, "AMR-03", "AMR-02", "AMR-01", "AMR-04")
            await last.hover()
            robot(hall, 4, 50, header_id=2, **STOP)
            await expect(last).to_contain_text("Emergency stop")
            await expect(page.locator("tr[data-robot]").last).to_contain_text("AMR-04")
            await last.get_by_role("link", name="AMR-04").focus()
            await page.mouse.move(5, 5)
            await expect(page.locator("tr[data-robot]").last).to_contain_text("AMR-04")
            await page.get_by_role("searchbox").focus()
            await expect(page.locator("tr[data-robot]").nth(1)).to_contain_text("AMR-04")


async def test_one_search_finds_robots_orders_and_places(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await expect(page.get_by_role("tab", name="Orders")).to_have_text("Orders (2)")
            await page.keyboard.press("/")
            search = page.get_by_role("searchbox", name="Search")
            await expect(search).to_be_focused()
            await page.keyboard.type("wms-042")
            await expect(page.locator("tr[data-order='WMS-042']")).to_be_visible()  # its tab comes forward
            await expect(page.locator("tr[data-order='WMS-041']")).to_have_count(0)
            await expect(page).to_have_url(re.compile(r"#/\?q=wms-042$"))
            await page.keyboard.press("Enter")
            await expect(page.locator("nena-order-page h2")).to_have_text("WMS-042")
            await search.fill("storage")
            await expect(page.get_by_role("link", name="Storage", exact=True)).to_be_visible()
            await search.fill("amr-03")
            await search.press("Enter")
            await expect(page.locator("nena-robot-page h2")).to_have_text("AMR-03")
            await page.get_by_role("button", name="2 Idle").click()
            await search.fill("amr-03")  # an exact name is found whatever the filter
            await expect(page.locator("tr[data-robot='ACME/r003']")).to_be_visible()
            await search.fill("wms-042")
            await expect(page.locator("tr[data-order='WMS-042']")).to_be_visible()
            await page.get_by_role("tab", name="Robots").click()
            await expect(page.get_by_role("tab", name="Robots")).to_have_attribute("aria-selected", "true")
            await search.fill("nowhere")
            await expect(page.get_by_role("tabpanel").get_by_text("No match")).to_be_visible()
            assert await findings(page) == []
            await page.get_by_role("tabpanel").get_by_role("button", name="Show all").click()
            await expect(page.get_by_role("tab", name="Robots")).to_have_text("Robots (4)")


async def test_tabs_are_switched_by_keyboard(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url) as page:
            await page.get_by_role("tab", name="Robots").focus()
            await page.keyboard.press("ArrowRight")
            orders = page.get_by_role("tab", name="Orders")
            await expect(orders).to_be_focused()
            await expect(page.locator("tr[data-order='WMS-041']")).to_be_visible()
            await page.get_by_role("button", name="Open 1").click()
            await expect(page.locator("tr[data-order='WMS-042']")).to_have_count(0)
            assert await findings(page) == []
            await picture(page, "orders")


async def test_orders_that_gave_way_or_were_withdrawn_are_not_among_the_failed(
    hall: Hall, browser: Browser
) -> None:
    async with hall.connected():
        hall.publish_order(1, TransportOrderState.FAILED, "Park-1", outcome=OrderOutcome.GAVE_WAY)
        hall.publish_order(1, TransportOrderState.FAILED, "TO-3", outcome=OrderOutcome.WITHDRAWN)
        hall.publish_order(1, TransportOrderState.FAILED, "TO-2")
        async with opened(browser, f"{hall.url}#/?tab=orders") as page:
            await page.get_by_role("button", name="Failed 1").click()
            await expect(page.locator("tr[data-order='TO-2']")).to_be_visible()
            await page.get_by_role("button", name="Withdrawn 2").click()
            await expect(page.locator("tr[data-order='TO-3'] .chip")).to_have_text("Withdrawn")
            await page.get_by_role("button", name="Failed 1").click()
            for other in ("Park-1", "TO-3"):
                await expect(page.locator(f"tr[data-order='{other}']")).to_have_count(0)


async def test_automatic_orders_are_shown_on_request_and_chips_add_up(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_order(1, TransportOrderState.DISPATCHABLE, "TO-1")
        hall.publish_order(1, TransportOrderState.FAILED, "TO-2", outcome=OrderOutcome.WITHDRAWN)
        hall.publish_order(
            1, TransportOrderState.FAILED, "Park-1", outcome=OrderOutcome.GAVE_WAY, automatic=True
        )
        async with opened(browser, f"{hall.url}#/?tab=orders", width=1600, height=1000) as page:
            tab = page.get_by_role("tab", name="Orders")
            await expect(tab).to_have_text("Orders (2)")
            await expect(page.get_by_role("button", name="Open 1")).to_be_visible()
            await expect(page.get_by_role("button", name="Withdrawn 1")).to_be_visible()
            row = page.locator("tr[data-order='TO-1']")
            box = await row.bounding_box()
            assert box is not None
            assert box["height"] < 34, "one line"
            await page.get_by_role("button", name="Parking and charging too").click()
            await expect(tab).to_have_text("Orders (3)")
            await expect(page.locator("tr[data-order='Park-1'] .chip")).to_have_text("Gave way")
            assert await findings(page) == []


async def test_columns_are_chosen_and_stored(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            shown = page.locator("#robots thead th:visible")
            usual = ["Robot", "Condition", "Battery", "Order", "Last state"]

            async def titled(*titles: str) -> None:
                await expect(shown).to_have_text([re.compile(rf"^\s*{each}") for each in titles])

            await expect(page.locator("tr[data-robot]").first).to_be_visible()
            await titled(*usual)
            await page.locator("#robots").get_by_label("Columns").click()
            await page.get_by_role("checkbox", name="Battery").uncheck()
            await page.get_by_role("checkbox", name="Place").check()
            chosen = ["Robot", "Condition", "Order", "Last state", "Place"]
            await titled(*chosen)
            row = page.locator("tr[data-robot='ACME/r001'] td:visible")
            await expect(row).to_have_count(len(chosen))
            assert await findings(page) == []
            await picture(page, "columns")
            await page.reload()
            await expect(page.locator("tr[data-robot]").first).to_be_visible()
            await titled(*chosen)
            await page.locator("#robots").get_by_label("Columns").click()
            await expect(page.get_by_role("checkbox", name="Battery")).not_to_be_checked()
            await page.get_by_role("checkbox", name="Battery").check()
            await page.get_by_role("checkbox", name="Place").uncheck()
            await titled(*usual)


async def test_several_robots_are_paused_at_once(hall: Hall, browser: Browser) -> None:
    sent: list[tuple[str, Any]] = []

    async def order_service(route: Route, body: Any) -> None:
        vehicle = route.request.url.split("/")[-2]
        sent.append((vehicle, body))
        status = "FAILED" if vehicle == "AMR-04" else "FINISHED"
        done = {
            "actionId": "1",
            "actionType": "startPause",
            "status": status,
            "reason": "it stands in a lift",
        }
        await route.fulfill(json=done)

    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        shift(hall)
        async with opened(browser, hall.url, width=1600, height=1000, expected=("502",)) as page:
            await answered(page, "**/instantActions", order_service)
            await expect(page.get_by_role("button", name="Pause")).to_be_hidden()
            for name in ("AMR-01", "AMR-02", "AMR-04"):
                await page.get_by_role("checkbox", name=f"Select {name}").check()
            await expect(page.get_by_text("3 robots selected")).to_be_visible()
            await page.get_by_role("searchbox").fill("AMR-01")
            await expect(page.get_by_text("hidden by the filter: AMR-02, AMR-04")).to_be_visible()
            await page.get_by_role("searchbox").fill("")
            await page.get_by_role("button", name="Pause").dblclick()
            told = page.locator("nena-fleet-commands .result")
            await expect(told).to_contain_text("2 of 3 paused")
            await expect(told).to_contain_text("Pause failed on AMR-04: it stands in a lift")
            marked = ("AMR-01", "AMR-02", "AMR-04")
            assert sorted(sent) == [(name, {"actionType": "pause"}) for name in marked]
            assert await findings(page) == []
            await picture(page, "several")
            sent.clear()
            await page.get_by_role("button", name="Resume", exact=True).click()
            await expect(page.get_by_text("These robots continue: AMR-01, AMR-02, AMR-04")).to_be_focused()
            assert sent == []
            await page.get_by_role("button", name="Resume 3 robots now").click()
            await expect(told).to_contain_text("2 of 3 resumed")
            assert sorted(sent) == [(name, {"actionType": "resume"}) for name in marked]
            await page.get_by_role("button", name="Clear selection").click()
            await expect(page.get_by_text("robots selected")).to_be_hidden()


async def test_orders_of_several_robots_are_cancelled_and_the_robots_parked(
    hall: Hall, browser: Browser
) -> None:
    sent: list[tuple[str, dict[str, Any]]] = []

    async def order_service(route: Route, body: Any) -> None:
        path = urlsplit(route.request.url).path.split("/control/")[1]
        sent.append((path, body))
        await route.fulfill(json={"name": "Park-1", "status": "FINISHED"})

    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        shift(hall)
        robot(hall, 5, order="WMS-041")
        async with opened(browser, hall.url, width=1600, height=1000, expected=("502",)) as page:
            await answered(page, re.compile("/withdrawal$|/transportOrders$|/instantActions$"), order_service)
            for name in ("AMR-01", "AMR-05"):
                await page.get_by_role("checkbox", name=f"Select {name}").check()
            await page.get_by_role("button", name="Cancel orders …").click()
            question = page.locator("nena-fleet-commands .question")
            await expect(question).to_contain_text("their orders end as withdrawn")
            await expect(question.get_by_role("listitem")).to_have_text(
                [re.compile("^AMR-05, WMS-041: "), "Without an order: AMR-01"]
            )
            assert sent == []
            await picture(page, "several-cancelled")
            await page.get_by_role("button", name="Cancel 1 order now").click()
            told = page.locator("nena-fleet-commands .result")
            await expect(told).to_have_text("1 of 1 orders cancelled")
            reason = {"reason": "withdrawn at the control panel"}
            assert sent == [("transportOrders/WMS-041/withdrawal", reason)]
            sent.clear()
            await plan_shown(page)
            await page.get_by_role("button", name="Send to park …").click()
            lines = question.get_by_role("listitem")
            await expect(lines).to_have_text(
                ["AMR-01 → Parking bay", "No free parking position, or position unknown: AMR-05"]
            )
            assert await findings(page) == []
            await page.get_by_role("button", name="Park 1 robot now").click()
            await expect(told).to_have_text("1 of 1 parking orders created")
            [(path, body)] = sent
            assert path == "transportOrders"
            assert body.pop("idempotencyKey")
            assert body == {
                "destinations": [{"locationName": "Parking bay", "operation": "PARK"}],
                "intendedVehicle": "AMR-01",
                "type": "Park",
                "dispensable": True,
            }


async def test_list_of_a_thousand_robots_stays_usable(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        for number in range(1, MANY + 1):
            robot(hall, number, **(STOP if number == MANY else {}))
        async with opened(browser, hall.url) as page:
            await expect(page.get_by_role("tab", name="Robots")).to_have_text(re.compile(r"\(1,000\)"))
            rows = page.locator("tr[data-robot]")
            await expect(rows.first).to_contain_text(f"AMR-{MANY}")
            assert await rows.count() < 60  # only those in sight
            await page.locator("#lists").evaluate("(list) => list.scrollTo(0, list.scrollHeight)")
            await expect(page.locator(f"tr[data-robot='ACME/r{MANY - 1}']")).to_be_in_viewport()
            await expect(page.get_by_role("columnheader", name="Battery")).to_be_in_viewport()
            assert await rows.count() < 60
            seconds = min([await page.evaluate(SEARCH_SECONDS, word) for word in ("AMR-77", "AMR-5", "r9")])
            assert seconds < USABLE_WITHIN, f"{seconds:.2f} s for a search"


@pytest.mark.parametrize(("language", "title"), [("en-GB", "Needs attention"), ("de-DE", "Eingriff nötig")])
async def test_phone_shows_robots_that_need_attention_then_the_search(
    hall: Hall, browser: Browser, language: str, title: str
) -> None:
    async with hall.connected():
        shift(hall)
        async with opened(browser, hall.url, width=390, height=844, language=language) as page:
            needs = page.get_by_role("region", name=title)
            await expect(needs.get_by_role("link")).to_have_text(["AMR-03"])
            search = page.get_by_role("searchbox")
            await expect(search).to_be_in_viewport()
            above, below = await needs.bounding_box(), await search.bounding_box()
            assert above is not None
            assert below is not None
            assert above["y"] < below["y"]
            assert await findings(page) == []
            await fits(page, 390)
            if language == "en-GB":
                await picture(page, "telephone-list")
            await page.get_by_role("tab", name="Map" if language == "en-GB" else "Karte").click()
            await expect(page.locator("nena-fleet-map canvas")).to_be_in_viewport()
            await expect(page.locator("tr[data-robot]").first).to_be_hidden()


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en-GB", ("Vehicle-1 drives to Goods in.", "Waits for a free vehicle.", "Held by Anna", "drives")),
        ("de-DE", ("Goods in: Load (unterwegs)", "Wartet auf einen Roboter.", "(Anna) seit", "Pausiert.")),
        ("nl-NL", ("Goods in: Load (onderweg)", "Wacht op een robot.", "door Anna sinds", "Gepauzeerd.")),
    ],
)
async def test_status_of_an_order_is_in_the_language_of_the_panel(
    hall: Hall, browser: Browser, language: str, words: tuple[str, str, str, str]
) -> None:
    async with hall.connected():
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED, "TO-1")
        waits: dict[str, Any] = {
            "reason": "Waits for a free vehicle.",
            "processing_vehicle": None,
            "current_drive_order_index": -1,
        }
        hall.publish_order(1, TransportOrderState.DISPATCHABLE, "TO-2", **waits)
        hold = Hold(by="Anna", reason="Ware fehlt", since=datetime.now(UTC))
        held = {**waits, "reason": "Held by Anna: Ware fehlt", "held": hold}
        hall.publish_order(1, TransportOrderState.DISPATCHABLE, "TO-3", **held)
        robot(hall, 4, 80, paused=True)
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED, "TO-4", processing_vehicle="AMR-04")
        async with opened(browser, f"{hall.url}#/?tab=orders", language=language) as page:
            for number, each in enumerate(words, start=1):
                await expect(page.locator(f"tr[data-order='TO-{number}']")).to_contain_text(each)
            if language != "en-GB":
                await expect(page.locator("tr[data-order='TO-1'] [lang=en]")).to_have_text("")
                await expect(page.locator("tr[data-order='TO-2'] [lang=en]")).to_have_text(waits["reason"])


@pytest.mark.parametrize("language", LANGUAGES)
async def test_a_robot_out_of_use_is_marked_in_list_and_map_with_who_did_it(
    hall: Hall, browser: Browser, language: str
) -> None:
    say = Texts(language)
    use = say("integration.TO_BE_RESPECTED").partition(":")[0]
    since = datetime.now(UTC)
    async with hall.connected():
        hall.publish_plant()
        robot(hall, 1)
        robot(hall, 2)
        status = vehicle_status(
            "AMR-02",
            robot=RobotKey("ACME", "r002"),
            integration_level="TO_BE_RESPECTED",
            level_set=SetBy(by="Anna", since=since),
        )
        topic = hall.fleet.vehicle_status("r002")
        hall.peer.publish(topic, status.model_dump_json(by_alias=True), retain=True)
        async with opened(browser, hall.url, language=language) as page:
            marks = page.locator("tr[data-robot] .use")
            await expect(marks.filter(has_text=use)).to_have_count(1)
            await becomes(page, LABELS, None, lambda labels: f"AMR-02 ({use})" in labels)
            assert await findings(page) == []
            for width in (1600, 1280, 390):
                await page.set_viewport_size({"width": width, "height": 900})
                await picture(page, f"out-of-use-{width}-{language[:2]}")
            await visit(page, hall.url + "#/robots/ACME%2Fr002")
            head = page.locator("nena-robot-page .head")
            await expect(head).to_contain_text(f"{use} {say('order.heldBy', by='Anna', time='')}".strip())
