"""The history: the slider replays the map, and events are filtered and grouped."""

from __future__ import annotations

import asyncio
import re
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Error, Page, Route, expect

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_status_aggregator.fleet.events import Code, Event, Values
from support.fleet_examples import ROBOT, connection, position, state
from support.panel import LABELS, Hall, becomes, findings, opened, picture, saved, seconds_now, visit
from support.panel_history import SLIDE, recorded
from support.panel_texts import Texts
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

OTHER = RobotKey("ACME", "r2")
LISTED = 60
"""Maximum number of events or orders that the page lists."""

REPLAY = "**/api/v1/replay?*"

SHOWN = """() => document.querySelector("nena-fleet-map").replayed?.robots.map(
  (robot) => [robot.id, Math.round(robot.position.x), robot.condition]
)"""
"""The robots that the map shows of the history."""

LEAVE_WHILE_NARROWING = """() => {
  location.hash = "#/robots/ACME%2Fr1";
  const search = document.querySelector("nena-history-page input[type=search]");
  search.dispatchEvent(new Event("input", { bubbles: true }));
}"""
"""Change a filter after the address, before the panel has noticed the new address."""


async def positions(hall: Hall) -> list[str]:
    """Return the times of the positions in the history, oldest first."""
    async with httpx.AsyncClient(base_url=hall.url, timeout=PATIENCE) as client:
        found = (await client.get("/api/v1/history?code=position")).json()["entries"]
    return [entry["time"] for entry in reversed(found)]


async def test_the_slider_shows_where_a_robot_was(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    async with hall.connected("--history.url", f"sqlite:///{tmp_path}/history.db"):
        hall.publish_plant()
        hall.send(Topic.CONNECTION, connection(), retain=True)
        for number, x in enumerate((3, 9, 15), start=1):
            here = position(x, 2)
            told = state(number, at=seconds_now(), driving=number < 3, mobile_robot_position=here)
            hall.send(Topic.STATE, told)
            await awaited(
                lambda: positions(hall),
                lambda times, number=number: len(times) == number,  # type: ignore[misc]
                seconds=PATIENCE,
                what=f"position {number} is in the history",
            )
        times = await positions(hall)
        async with opened(browser, hall.url) as page:
            await page.get_by_role("link", name="History").click()
            await becomes(page, SHOWN, None, lambda shown: shown == [["ACME/r1", 15, "IDLE"]])
            events = page.locator("nena-history-page .history li")
            await expect(events.first).to_contain_text("r1")
            await page.evaluate(f"({SLIDE})(Date.parse('{times[0]}') - 500)")
            await becomes(page, SHOWN, None, lambda shown: shown == [["ACME/r1", 3, "SILENT"]])
            between = f"(Date.parse('{times[0]}') + Date.parse('{times[1]}')) / 2"
            await page.evaluate(f"({SLIDE})(Math.floor({between}))")
            await becomes(page, SHOWN, None, lambda shown: 3 <= shown[0][1] < 9 and shown[0][2] == "BUSY")
            await expect(page.get_by_text("Replay:")).to_be_visible()
            await picture(page, "history")
            await page.get_by_label("Speed").select_option("10")
            await page.get_by_role("button", name="Play").click()
            await becomes(page, SHOWN, None, lambda shown: shown[0][1] >= 9)
            csv = await saved(page, page.get_by_role("link", name="Download CSV"), tmp_path)
            assert csv.count(",position,") == 3
            await page.get_by_role("link", name="All robots and orders").click()
            await expect(page.get_by_text("Replay:")).to_be_hidden()
            assert await page.evaluate(SHOWN) is None
            await another_range_and_leaving_abort_the_load(page)
            for broken in ("from=x", "from=2026-01-01T00:00:00Z", "from=x&to=y"):
                await visit(page, f"{hall.url}#/history?{broken}")
                await expect(page.get_by_label("Time range")).to_have_value("minutes10")
            await expect(page.get_by_role("button", name="Play")).to_be_enabled()
            await page.evaluate(LEAVE_WHILE_NARROWING)
            await expect(page.get_by_role("button", name="Play")).to_be_hidden()
            assert await page.evaluate("location.hash") == "#/robots/ACME%2Fr1"


LOOKS = """() => document.querySelector("nena-fleet-map").replayed?.robots.map(
  (robot) => [robot.id, robot.condition, robot.urgent, robot.loads.length]
)"""


JAMMED = f"() => ({LABELS})().some((text) => text.includes('jam: 7'))"


def changed(time: datetime, robot: str, condition: str, **values: str) -> Event:
    return Event(time, Code.CONDITION, "", robot, values={"condition": condition, **values})


def placed(time: datetime, robot: str, x: float, y: float = 2) -> Event:
    return Event(time, Code.POSITION, "", robot, values={"x": x, "y": y, "theta": 0, "mapId": "hall"})


async def test_what_waits_or_needs_a_person_looks_as_it_did_live(
    hall: Hall, browser: Browser, tmp_path: Path
) -> None:
    begin = datetime.now(UTC) - timedelta(minutes=20)

    def minute(number: float) -> datetime:
        return begin + timedelta(minutes=number)

    r1, gone = "ACME/r1", "ACME/gone"
    area = {"xMin": 7.0, "yMin": 3.0, "xMax": 9.0, "yMax": 5.0}
    stop: Values = {"stop": "S-1", "by": "Anna", "reason": "oil", **area}
    events = [
        placed(minute(0), r1, 3),
        changed(minute(0), r1, "BUSY", before="IDLE", reason="driving"),
        Event(minute(1), Code.LOADS, "", r1, values={"loads": 1, "before": 0}),
        # The range begins here.
        placed(minute(12), gone, 5),
        changed(
            minute(12), gone, "WAITING", before="BUSY", reason="waits_passing", at="Middle 3", vehicles="r2"
        ),
        changed(minute(14), r1, "BLOCKED", before="BUSY", reason="emergency_stop", how="remotely"),
        Event(minute(14.5), Code.JAM, "", r1, values={"robots": 7}),
        Event(minute(14.6), Code.STOP, "", values={"active": True, **stop}),
        Event(minute(16), Code.ROBOT_FORGOTTEN, "", gone),
        Event(minute(16.2), Code.JAM, "", r1, values={"robots": 0}),
        Event(minute(16.4), Code.STOP, "", values={"active": False, **stop}),
    ]
    async with hall.connected(*recorded(tmp_path, events)):
        hall.publish_plant()
        hall.send(Topic.CONNECTION, connection(), retain=True)
        async with opened(browser, hall.url) as page:
            await page.get_by_role("link", name="History").click()
            await expect(page.get_by_role("button", name="Play")).to_be_enabled()
            for number, shown in (
                (11, [["ACME/gone", "BUSY", False, 0], ["ACME/r1", "BUSY", False, 1]]),
                (13, [["ACME/gone", "WAITING", False, 0], ["ACME/r1", "BUSY", False, 1]]),
                (15, [["ACME/gone", "WAITING", False, 0], ["ACME/r1", "BLOCKED", True, 1]]),
                (17, [["ACME/r1", "BLOCKED", True, 1]]),
            ):
                await page.evaluate(f"({SLIDE})({minute(number).timestamp() * 1000:.0f})")
                await becomes(page, LOOKS, None, lambda found, shown=shown: found == shown)  # type: ignore[misc]
                jammed, areas = number == 15, [area] if number == 15 else []
                await becomes(page, JAMMED, None, lambda found, jammed=jammed: found is jammed)  # type: ignore[misc]
                assert await page.evaluate("document.querySelector('nena-fleet-map').replayed.areas") == areas
                if number == 15:
                    await picture(page, "history-urgent")
            listed = page.locator("nena-history-page .history")
            await expect(listed).to_contain_text("Anna (oil): Stop ended")
            await expect(listed).to_contain_text("7 robots wait behind it")


@pytest.mark.parametrize("language", ["en-GB", "de-DE", "nl-NL"])
async def test_a_stop_of_many_robots_is_one_row_that_opens(
    hall: Hall, browser: Browser, tmp_path: Path, language: str
) -> None:
    begin, say = datetime.now(UTC) - timedelta(minutes=5), Texts(language)
    end = begin + timedelta(minutes=1)
    stop: Values = {"stop": "S-1", "by": "Anna", "reason": "oil"}
    robots = [f"ACME/r{number}" for number in range(12)]
    soon = timedelta(seconds=1)
    why = {"by": "Anna", "why": "oil"}
    events = [
        changed(begin - soon, "ACME/other", "BUSY", before="IDLE", reason="driving_free"),
        Event(begin, Code.STOP, "", values={"active": True, **stop}),
        *(changed(begin + soon, each, "BLOCKED", before="BUSY", reason="paused") for each in robots),
        *(
            changed(begin + 2 * soon, each, "BLOCKED", before="BLOCKED", reason="stopped", **why)
            for each in robots
        ),
        Event(end, Code.STOP, "", values={"active": False, **stop}),
        *(changed(end + soon, each, "BUSY", before="BLOCKED", reason="driving_free") for each in robots),
    ]
    async with (
        hall.connected(*recorded(tmp_path, events)),
        opened(browser, hall.url, width=1600, height=1000, language=language) as page,
    ):
        await visit(page, hall.url + "#/history")
        rows = page.locator("nena-history-page section > .history > li")
        await expect(rows.filter(has_text=say("eventLog.condition"))).to_have_count(3)  # two in stops
        stopped = rows.filter(has_text=say("done.stop"))
        followers = stopped.locator("details li")
        await expect(followers).to_have_count(24)
        await expect(followers.first).to_be_hidden()
        await stopped.locator("summary", has_text=say("attention.robots.other", count=12)).click()
        await expect(followers.first).to_be_visible()
        assert await findings(page) == []
        for width in (1600, 1280, 390):
            await page.set_viewport_size({"width": width, "height": 900})
            await picture(page, f"history-stop-{width}-{language[:2]}")


async def test_an_hour_of_many_robots_is_replayed_from_its_begin(
    hall: Hall, browser: Browser, tmp_path: Path
) -> None:
    """52 robots make more entries in an hour than a browser would load one by one."""
    begin = datetime.now(UTC) - timedelta(minutes=59)
    events = [
        placed(begin + timedelta(seconds=second), f"ACME/r{number}", 1 + second / 100, 1 + number / 5)
        for second in range(0, 3500, 7)
        for number in range(52)
    ]
    looks = [changed(begin, f"ACME/r{number}", "BUSY", reason="driving") for number in range(52)]
    async with hall.connected(*recorded(tmp_path, [*looks, *events])):
        hall.publish_plant()
        given = f"from={begin - timedelta(minutes=1):%FT%TZ}&to={begin + timedelta(hours=1):%FT%TZ}"
        async with opened(browser, f"{hall.url}#/history?{given}") as page:
            await expect(page.get_by_role("slider")).to_be_enabled()
            slide = f"({SLIDE})({(begin.timestamp() + 60) * 1000:.0f})"
            await page.evaluate(slide)
            await becomes(
                page, SHOWN, None, lambda shown: len(shown) == 52 and {each[1] for each in shown} == {2}
            )
            await expect(page.locator("nena-history-page section > .history > li").first).to_contain_text(
                "r51"
            )
            await page.get_by_label("Speed").select_option("60")
            await page.get_by_role("button", name="Play").click()
            await becomes(page, SHOWN, None, lambda shown: shown[0][1] >= 5)


NOTE_ABORTED = """() => {
  window.aborted = [];
  const real = window.fetch;
  window.fetch = (url, options) => {
    if (url.includes("/replay")) options.signal.addEventListener("abort", () => window.aborted.push(url));
    return real(url, options);
  };
}"""
"""Notes which loads of a replay the page aborts; Firefox does not report it of a request that is held up."""


async def another_range_and_leaving_abort_the_load(page: Page) -> None:
    begun, over = list[str](), asyncio.Event()

    async def late(route: Route) -> None:
        begun.append(route.request.url)
        await over.wait()
        with suppress(Error):  # aborted meanwhile
            await route.continue_()

    async def loads() -> int:
        return len(begun)

    await page.route(REPLAY, late)
    await page.evaluate(NOTE_ABORTED)
    await page.get_by_role("link", name="History").click()
    await awaited(loads, lambda count: count == 1, seconds=PATIENCE, what="the history loads")
    await expect(page.get_by_role("slider")).to_be_disabled()  # it is moved to the end once it is loaded
    await expect(page.get_by_role("button", name="Play")).to_be_disabled()
    await page.get_by_label("Time range").select_option("hour")
    await becomes(page, "aborted", None, lambda urls: len(urls) == 1)
    await awaited(loads, lambda count: count == 2, seconds=PATIENCE, what="the other range loads")
    await page.get_by_role("link", name="All robots and orders").click()
    await becomes(page, "aborted", None, lambda urls: len(set(urls)) == 2)
    over.set()
    await page.unroute(REPLAY)
    await page.evaluate("fetch('api/v1/history?limit=1').then((answer) => answer.text())")
    assert await page.evaluate(SHOWN) is None  # the map stays live


async def test_page_reports_a_missing_history(hall: Hall, browser: Browser) -> None:
    async with (
        hall.connected("--history.url", "none"),
        opened(browser, f"{hall.url}#/history", expected=("404",)) as page,
    ):
        await expect(page.get_by_text("No history")).to_be_visible()
        await expect(page.get_by_role("button", name="Play")).to_be_disabled()


async def number_of(hall: Hall, code: str) -> int:
    async with httpx.AsyncClient(base_url=hall.url, timeout=PATIENCE) as client:
        return len((await client.get(f"/api/v1/history?code={code}")).json()["entries"])


async def test_events_are_filtered_grouped_and_linked(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    async with hall.connected("--history.url", f"sqlite:///{tmp_path}/history.db"):
        hall.publish_plant()
        error = {"error_type": "NODE_UNREACHABLE", "error_level": "WARNING", "error_description": "no way"}
        for robot, errors in ((ROBOT, (error,)), (OTHER, ())):
            hall.send(Topic.CONNECTION, connection(robot=robot), robot=robot, retain=True)
            hall.send(Topic.STATE, state(robot=robot, at=seconds_now(), errors=errors), robot=robot)
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED, "WMS-1")
        hall.publish_order(2, TransportOrderState.FAILED, "WMS-1")
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED, "WMS-2")
        for code, count in (("errorRaised", 1), ("transportOrder", 3)):
            await awaited(
                lambda code=code: number_of(hall, code),  # type: ignore[misc]
                lambda found, count=count: found >= count,  # type: ignore[misc]
                seconds=PATIENCE,
                what=f"{code} is in the history",
            )
        async with opened(browser, hall.url) as page:
            await page.get_by_role("link", name="History").click()
            shown = page.locator("nena-history-page")
            events = shown.locator("section > .history > li")
            await expect(events.filter(has_text="r2").first).to_be_visible()
            await shown.get_by_label("Robot").select_option("ACME/r1")
            await expect(events.filter(has_text="r2")).to_have_count(0)
            await shown.get_by_label("Severity").select_option("problems")
            await expect(events).to_have_count(1)
            await expect(events).to_contain_text("Cannot reach the next point: no way")
            await expect(shown.locator(".marks i")).to_have_count(1)
            assert await findings(page) == []
            linked = page.url
            await page.goto("about:blank")
            await page.goto(linked)  # with its time range
            await expect(events).to_have_count(1)
            await expect(page.get_by_label("Time range")).to_have_value("given")
            await a_typed_time_range_is_loaded_and_linked(page)
            await shown.get_by_label("Robot").select_option("")
            await shown.get_by_label("Severity").select_option("")
            await shown.get_by_label("Kind").select_option("transportOrder")
            await shown.get_by_role("searchbox", name="Order").fill("wms")
            await page.get_by_label("Group by order").check()
            await expect(events).to_have_count(2)
            group = events.filter(has_text="WMS-1")
            await expect(group).to_contain_text("2 events")
            await group.locator("summary").click()
            await expect(group.get_by_text("Transport order").first).to_be_visible()
            assert await findings(page) == []
            await picture(page, "history-by-order")
            await the_list_says_what_it_leaves_out(page, hall)
        await events_are_in_the_language_of_the_panel(browser, hall)


async def a_typed_time_range_is_loaded_and_linked(page: Page) -> None:
    events = page.locator("nena-history-page section > .history > li")
    now = await page.evaluate("Date.now()")
    field_time = "(ms) => new Date(ms - new Date(ms).getTimezoneOffset() * 60000).toISOString().slice(0, 16)"
    hour_ago, in_an_hour = [await page.evaluate(field_time, now + hours * 3_600_000) for hours in (-1, 1)]
    async with page.expect_response("**/api/v1/history?*"):
        await page.get_by_label("From", exact=True).fill(hour_ago)
    await expect(page.get_by_text("Loading …")).to_be_hidden()
    await expect(events).to_have_count(1)
    await page.get_by_label("To", exact=True).fill(hour_ago)
    await expect(page.get_by_text("The start must be before the end.")).to_be_visible()
    await page.get_by_label("To", exact=True).fill("")
    await expect(page.get_by_text("Enter both times")).to_be_visible()
    await page.get_by_label("To", exact=True).fill(in_an_hour)
    await expect(page.get_by_label("Time range")).to_have_value("given")
    await expect(events).to_have_count(1)
    linked = page.url
    await page.goto("about:blank")
    await page.goto(linked)
    await expect(page.get_by_label("From", exact=True)).to_have_value(hour_ago)
    await expect(page.get_by_label("To", exact=True)).to_have_value(in_an_hour)
    await expect(events).to_have_count(1)
    await page.get_by_label("Time range").select_option("hour")
    await expect(page.get_by_label("To", exact=True)).not_to_have_value(in_an_hour)


async def events_are_in_the_language_of_the_panel(browser: Browser, hall: Hall) -> None:
    async with opened(browser, f"{hall.url}#/history", language="de-DE") as page:
        events = page.locator("nena-history-page section > .history > li")
        kind = page.locator("nena-history-page").get_by_label("Art")  # as "Karte" contains it
        for code, text in (
            ("transportOrder", "In Ausführung"),
            ("condition", "Frei: Kein Auftrag."),
            ("connection", "online"),
            ("errorRaised", "Nächster Punkt nicht erreichbar: no way"),
            ("link", "Verbunden."),
        ):
            await kind.select_option(code)
            await expect(events.first).to_contain_text(text)
        await expect(page.get_by_text("BEING_PROCESSED")).to_have_count(0)


async def the_list_says_what_it_leaves_out(page: Page, hall: Hall) -> None:
    events = page.locator("nena-history-page section > .history > li")
    for number in range(LISTED + 1):
        hall.publish_order(1, TransportOrderState.BEING_PROCESSED, f"L-{number}")
    await awaited(
        lambda: number_of(hall, "transportOrder"),
        lambda found: found == LISTED + 4,
        seconds=PATIENCE,
        what="all orders are in the history",
    )
    await page.goto("about:blank")
    await page.goto(f"{hall.url}#/history?kind=transportOrder")
    await expect(page.get_by_text(f"Showing the latest {LISTED} up to the time")).to_be_visible()
    await expect(events).to_have_count(LISTED)
    await page.get_by_label("Group by order").check()
    await expect(events).to_have_count(LISTED)
    await expect(page.get_by_text(f"Showing the latest {LISTED} up to the time")).to_be_visible()
    file = page.get_by_role("link", name="Download CSV")
    await expect(file).to_have_attribute("href", re.compile("code=transportOrder$"))
