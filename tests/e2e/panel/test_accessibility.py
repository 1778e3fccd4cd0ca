"""Accessibility of the panel: languages, screen readers, keyboard, light and dark theme, phones."""

from __future__ import annotations

import re
from urllib.parse import urlsplit

import pytest
from playwright.async_api import Browser, Page, Route, expect

from nena_shared.fleet_api.peripherals import PeripheralJobState, PeripheralState
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_status_aggregator.api.app import PANEL
from support.broker import free_port
from support.fleet_examples import (
    ROBOT,
    connection,
    factsheet,
    peripheral_job,
    peripheral_status,
    position,
    state,
    vehicle_status,
    way,
)
from support.panel import Hall, findings, fits, opened, picture, seconds_now, visit

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

OTHER = RobotKey("ACME", "r2")
VIEWS = {
    "lists": "#/",
    "robot": "#/robots/ACME%2Fr1",
    "order": "#/orders/TO-1",
    "new-order": "#/orders",
    "past": "#/history",
    "reports": "#/reports",
    "place": "#/places/South%202",
    "devices": "#/?tab=peripherals",
    "device": "#/places/Packing",
}
NO_ORDER_SERVICE = ("502",)
"""The browser's error for an order service that is not running."""

BROKEN_LABELS = """() => [...document.querySelectorAll("[role=tab], #new-order")].filter((label) => {
  const text = document.createRange();
  text.selectNodeContents(label);
  const { right } = label.getBoundingClientRect();
  return label.offsetParent && (text.getClientRects().length > 1 || right > innerWidth);
}).map((label) => label.textContent)"""
"""Labels above the lists that take more than one line, or do not fit on the screen."""

UNMARKED = """() => {
  const left = [];
  const bare = (text) => {
    let rest = text;
    for (let before = null; before !== rest; ) [before, rest] = [rest, rest.replace(/⟦[^⟦⟧]*⟧/g, "")];
    return rest.trim();
  };
  const seen = (node) => !node.closest("[translate=no], script, noscript, time, h1");
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const rest = seen(walk.currentNode.parentElement) ? bare(walk.currentNode.data) : "";
    if (/\\p{L}/u.test(rest)) left.push(rest);
  }
  for (const node of document.querySelectorAll("[aria-label], [title], [placeholder]")) {
    for (const name of ["aria-label", "title", "placeholder"]) {
      const rest = seen(node) ? bare(node.getAttribute(name) ?? "") : "";
      if (/\\p{L}/u.test(rest)) left.push(`${name}: ${rest}`);
    }
  }
  return left;
}"""
"""Texts and labels with letters that are not from the catalogue, whose texts are marked by ⟦ ⟧."""


def populate(hall: Hall) -> None:
    """Publish something for every part of the page."""
    hall.publish_plant()
    hall.publish_map()
    hall.send(Topic.CONNECTION, connection(), retain=True)
    hall.send(Topic.FACTSHEET, factsheet(at=seconds_now()), retain=True)
    error = {
        "error_type": "NODE_UNREACHABLE",
        "error_level": "WARNING",
        "error_description": "no way to South 2",
        "error_references": ({"reference_key": "nodeId", "reference_value": "South 2"},),
    }
    action = {"action_id": "a1", "action_type": "pick", "action_status": "WAITING"}
    goal = {
        "info_type": "externalGoal",
        "info_level": "INFO",
        "info_references": ({"reference_key": "goalId", "reference_value": "b7"},),
    }
    waiting = state(
        at=seconds_now(),
        order_id="o1",
        last_node_id="South 1",
        last_node_sequence_id=2,
        mobile_robot_position=position(3, 2),
        loads=({"load_id": "crate 7"},),
        errors=(error,),
        action_states=(action,),
        information=(goal,),
        **way("South 2", first=4, released=0),
    )
    hall.send(Topic.STATE, waiting)
    here = position(9, 2, localized=False)
    other = state(robot=OTHER, at=seconds_now(), last_node_id="South 2", mobile_robot_position=here)
    hall.send(Topic.STATE, other, robot=OTHER)
    vehicle = vehicle_status(transport_order="TO-1").model_dump_json(by_alias=True)
    hall.peer.publish(hall.fleet.vehicle_status(ROBOT.serial_number), vehicle, retain=True)
    hall.publish_order(1, TransportOrderState.BEING_PROCESSED)
    jobs = (
        peripheral_job(related_vehicle="Vehicle-1", related_transport_order="TO-1", reason="waits"),
        peripheral_job("close", PeripheralJobState.FAILED, reason="blocked"),
    )
    hall.publish_peripheral(peripheral_status("Packing", PeripheralState.EXECUTING, *jobs))
    hall.publish_peripheral(peripheral_status("Goods in", PeripheralState.UNAVAILABLE, jobs[1]))


def commanded() -> tuple[str, str]:
    """Return options that enable commands in the page, although no program executes them."""
    return ("--order_service.url", f"http://127.0.0.1:{free_port()}")


async def show(page: Page, hall: Hall, view: str) -> None:
    """Open a view, and wait until it is filled."""
    await visit(page, hall.url + VIEWS[view])
    await expect(page.locator("tr[data-robot='ACME/r2']")).to_have_count(1)
    heads = {
        "robot": "nena-robot-page .causes",
        "order": "nena-order-page .causes",
        "new-order": "nena-order-form form",
        "place": "nena-place-page form",
        "devices": "tr[data-peripheral='Packing']",
        "device": "nena-peripheral-details li >> nth=1",
    }
    if view in heads:
        await expect(page.locator(heads[view])).to_be_visible()


async def test_no_text_is_outside_the_catalogue(hall: Hall, browser: Browser) -> None:
    async def marked(route: Route) -> None:
        source = (PANEL / urlsplit(route.request.url).path.lstrip("/")).read_text(encoding="utf-8")
        body = re.sub(r'": +"|":\n +"', lambda found: found.group() + "⟦", source).replace('",\n', '⟧",\n')
        await route.fulfill(body=body, content_type="text/javascript")

    async with hall.connected(*commanded()):
        populate(hall)
        async with opened(browser, hall.url, expected=NO_ORDER_SERVICE) as page:
            await page.route(re.compile(r"/texts/en[.]js"), marked)
            for view in VIEWS:
                await page.goto("about:blank")
                await show(page, hall, view)
                if view == "robot":
                    for name in ("Dispatch", "Set position", "Instant action"):
                        await page.get_by_role("button", name=f"⟦{name} …⟧").click()
                        await expect(page.locator("nena-robot-commands form")).to_be_visible()
                        assert await page.evaluate(UNMARKED) == [], name
                assert await page.evaluate(UNMARKED) == [], view


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("nl-NL", ("Robots", "Wacht", "Wacht bij South 1 tot South 2 is vrijgegeven.")),
        (
            "de-DE",
            ("Roboter", "Wartet", "Wartet bei South 1 auf die Freigabe von South 2."),
        ),
    ],
)
async def test_browser_language_is_used(
    hall: Hall, browser: Browser, language: str, words: tuple[str, ...]
) -> None:
    async with hall.connected():
        populate(hall)
        async with opened(browser, hall.url, language=language) as page:
            await expect(page.locator("html")).to_have_attribute("lang", language[:2])
            title, condition, reason = words
            await expect(page.get_by_role("tab", name=title)).to_have_text(f"{title} (2)")
            await expect(page.locator("tr[data-robot='ACME/r1']")).to_contain_text(condition)
            await expect(page.locator("tr[data-robot='ACME/r1']")).to_contain_text(reason)
            if language == "de-DE":
                await picture(page, "german")


async def test_language_is_switched_and_stored(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        populate(hall)
        async with opened(browser, hall.url + VIEWS["robot"]) as page:
            facts = page.locator("nena-robot-page .facts")
            await expect(facts).to_contain_text("x 3.00 m")
            await page.get_by_label("Language").select_option("de")
            await expect(page.get_by_role("heading", name="Warum fährt er nicht?")).to_be_visible()
            await expect(facts).to_contain_text("x 3,00 m")
            await page.reload()
            await expect(page.get_by_label("Sprache")).to_have_value("de")


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
async def test_axe_finds_nothing(hall: Hall, browser: Browser, *, dark: bool) -> None:
    async with hall.connected(*commanded()):
        populate(hall)
        async with opened(browser, hall.url, dark=dark, expected=NO_ORDER_SERVICE) as page:
            for view in VIEWS:
                await show(page, hall, view)
                if view == "robot":
                    await page.get_by_role("button", name="Dispatch …").click()
                if view == "lists":
                    await page.get_by_label("Layers").click()
                assert await findings(page, minor=True) == [], view


@pytest.mark.parametrize("language", [pytest.param("en-GB", marks=pytest.mark.long), "de-DE"])
async def test_no_view_is_wider_than_a_phone(hall: Hall, browser: Browser, language: str) -> None:
    async with hall.connected(*commanded()):
        populate(hall)
        async with opened(browser, hall.url, width=390, language=language, expected=NO_ORDER_SERVICE) as page:
            for view in VIEWS:
                await show(page, hall, view)
                if view == "lists":
                    assert await page.evaluate(BROKEN_LABELS) == []
                if view == "robot":
                    openers = page.locator("nena-robot-commands [aria-expanded]:not([hidden])")
                    await expect(openers.first).to_be_visible()
                    for opener in await openers.all():
                        await opener.click()
                        await fits(page, 390)
                await fits(page, 390)


async def test_a_robot_is_commanded_by_keys_alone(hall: Hall, browser: Browser) -> None:
    async with hall.connected(*commanded()):
        populate(hall)
        async with opened(browser, hall.url, expected=NO_ORDER_SERVICE) as page:
            link = page.get_by_role("link", name="Vehicle-1")
            await expect(link).to_be_visible()
            await expect(page.get_by_role("tab", name="Devices")).to_be_visible()  # the last one to come
            for _ in range(40):
                if await link.evaluate("each => each === document.activeElement"):
                    break
                await page.keyboard.press("Tab")
            await expect(link).to_be_focused()
            await page.keyboard.press("Enter")
            await expect(page.locator("nena-robot-page h2")).to_be_focused()
            pause = page.get_by_role("button", name="Pause")
            await expect(pause).to_be_visible()
            for _ in range(10):
                await page.keyboard.press("Tab")
                if await pause.evaluate("each => each === document.activeElement"):
                    break
            await page.keyboard.press("Enter")
            await expect(page.get_by_text("No answer from the order service")).to_be_visible()


async def test_chain_of_causes_links_robots(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        populate(hall)
        async with opened(browser, hall.url + VIEWS["order"]) as page:
            causes = page.locator("nena-order-page .causes li")
            await expect(causes).to_have_count(3)
            await expect(causes.nth(0)).to_contain_text("In progress.")
            await expect(causes.nth(1)).to_have_text(
                "Robot Vehicle-1 \u2013 Waiting at South 1 until South 2 is released."
            )
            await expect(causes.nth(2)).to_contain_text("Position lost: Not localised")
            await expect(causes.nth(2)).to_contain_text("Use Set position")
            await causes.nth(2).get_by_role("link").click()
            await expect(page.locator("nena-robot-page h2")).to_have_text("r2")
