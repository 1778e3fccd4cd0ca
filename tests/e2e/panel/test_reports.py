"""Reports in the panel, over a recorded shift whose figures were counted by hand."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.async_api import Browser, Page, Route, expect

from nena_shared.vda5050.topics import Topic
from nena_status_aggregator.fleet.events import Code, Event
from support.fleet_examples import connection, state
from support.panel import LABELS, Hall, becomes, findings, fits, opened, picture, saved, seconds_now
from support.panel_history import recorded, recorded_shift, yesterday

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

NOON_AFTER_CLOCKS_WENT_BACK = "Date.UTC(2026, 9, 26, 11)"
"""12:00 in Berlin, whose 25 October 2026 has 25 hours."""


def recorded_waits(folder: Path) -> tuple[str, str]:
    """Make a history of yesterday with waits of 5 minutes at South 2, and of 20 on the path to South 3."""

    def event(minute: float, condition: str, **values: str) -> Event:
        time = yesterday() + timedelta(hours=6, minutes=minute)
        return Event(time, Code.CONDITION, "", "ACME/r1", values={"condition": condition, **values})

    waits = [
        event(0, "WAITING", reason="waits_turn", at="South 2"),
        event(5, "BUSY", reason="driving"),
        event(10, "WAITING", reason="waits_passing", at="South 2 --- South 3"),
        event(30, "IDLE", reason="idle"),
    ]
    return recorded(folder, waits)


def link(hall: Hall, since: float = 6, until: float = 8) -> str:
    """Return the address of yesterday's report between two hours."""
    start, end = (yesterday() + timedelta(hours=hour) for hour in (since, until))
    return f"{hall.url}#/reports?from={start:%Y-%m-%dT%H:%M:%SZ}&to={end:%Y-%m-%dT%H:%M:%SZ}"


async def figure(page: Page, title: str) -> str:
    """Return a figure of the summary."""
    text = page.locator(".figures > div").filter(has_text=title).locator("dd")
    return await text.inner_text()


async def test_figures_are_those_of_the_hand_count(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    options = recorded_shift(tmp_path)
    async with hall.connected(*options):
        hall.publish_plant()
        async with opened(browser, link(hall), timezone="UTC") as page:
            await expect(page.locator(".figures")).to_be_visible()
            hall.send(Topic.CONNECTION, connection(), retain=True)  # a robot that is known after its report
            hall.send(Topic.STATE, state(at=seconds_now()))
            figures = {
                "Finished orders": "4",
                "Failed orders": "2",
                "Orders per hour": "2.2",
                "Lead time (50 %)": "20 min",
                "Lead time (95 %)": "25 min",
                "On time": "33 % (1 of 3)",
                "Utilisation": "37 %",
                "Share of waiting": "3 %",
                "Waiting, all robots added up": "5 min",
                "Empty distance": "23 %",
            }
            assert {title: await figure(page, title) for title in figures} == figures
            note = page.locator("nena-reports-page [role=status]")
            await expect(note).to_contain_text("No data for 11 min")
            await expect(note).to_contain_text("7 events were not recorded")
            rows = page.locator("nena-reports-page tbody tr")
            for texts in (
                ("06:00", "2", "1"),
                ("Lets other robots go first", "3 min"),
                ("r1", "23 %", "5 % (5 min)", "0.07 km, 23 % empty"),
                ("ACME/r2", "52 %", "0 % (0 s)", "3 min", "0.01 km", "1, from 30 %"),
                ("ACME/r3", "100 %"),
                ("ACME/r2", "Error", "orderError", "Critical", "2"),
                ("Vehicle-2", "Order failed", "Wheel lost."),
            ):
                row = rows
                for text in texts:
                    row = row.filter(has_text=text)
                await expect(row).not_to_have_count(0)
            assert await findings(page) == []
            await page.locator("nena-robot-table").wait_for(state="attached")
            await expect(rows.get_by_role("link", name="r1", exact=True)).not_to_have_count(0)
            await picture(page, "reports")
            await page.get_by_role("heading", name="Waiting").evaluate("title => title.scrollIntoView()")
            await picture(page, "reports-robots")
            table = await saved(page, page.get_by_role("link", name="Download CSV"), tmp_path)
            assert "orders,finished,,,4" in table


async def test_waiting_times_are_drawn_on_the_map(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    async with hall.connected(*recorded_waits(tmp_path)):
        hall.publish_plant()
        hall.send(Topic.CONNECTION, connection(), retain=True)
        hall.send(Topic.STATE, state(at=seconds_now()))
        async with opened(browser, link(hall), timezone="UTC", width=1600, height=1000) as page:
            places = page.locator("section").filter(has_text="Where robots wait").locator("tbody tr")
            await expect(places).to_have_count(2)
            await expect(places.first).to_contain_text("South 2 --- South 3")
            await expect(places.first).to_contain_text("20 min")
            assert not {"20 min", "5 min"} & set(await page.evaluate(LABELS))
            await page.get_by_role("button", name="Show on map").click()
            await becomes(page, LABELS, None, lambda labels: {"20 min", "5 min"} <= set(labels))
            note = page.locator("nena-fleet-map .heat")
            await expect(note).to_contain_text("Longest: South 2 --- South 3, 20 min.")
            assert await findings(page) == []
            await picture(page, "waiting-map")
            await page.get_by_label("From", exact=True).fill(f"{yesterday():%Y-%m-%d}T07:00")
            await expect(note).to_contain_text("No waiting was recorded")
            await page.get_by_label("Layers").click()
            await page.get_by_role("checkbox", name="Waiting times").uncheck()
            await expect(note).to_be_hidden()
            await page.get_by_role("checkbox", name="Waiting times").check()
            await page.goto("about:blank")
            await page.goto(hall.url)  # without a report, the last 24 hours
            await expect(note).to_be_visible()


@pytest.mark.parametrize("language", ["de-DE", "nl-NL"])
async def test_report_on_a_phone_in_the_dark(
    hall: Hall, browser: Browser, tmp_path: Path, language: str
) -> None:
    async with (
        hall.connected(*recorded_shift(tmp_path)),
        opened(browser, link(hall), width=390, height=844, dark=True, language=language) as page,
    ):
        await expect(page.locator(".figures")).to_be_visible()
        await fits(page, 390)
        assert await findings(page) == []
        await page.locator("nena-reports-page").scroll_into_view_if_needed()
        await picture(page, f"reports-telephone-{language[:2]}")
        titles = {"de-DE": ("Auslastung", "Durchlaufzeit"), "nl-NL": ("Bezetting", "Doorlooptijd")}[language]
        for title in titles:
            await expect(page.locator(".figures")).to_contain_text(title)


async def test_ranges_are_chosen_typed_and_linked(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    async with (
        hall.connected(*recorded_shift(tmp_path)),
        opened(browser, hall.url, timezone="UTC") as page,
    ):
        await page.get_by_role("link", name="Reports").click()
        kind = page.get_by_label("Time range")
        start, end = (page.get_by_role("textbox", name=name, exact=True) for name in ("From", "To"))
        await expect(kind).to_have_value("today")
        await kind.select_option("yesterday")
        finished = page.locator(".figures dd").first
        await expect(finished).to_have_text("6")  # also WMS-6 before the shift and WMS-8 after it
        assert f"from={yesterday():%Y-%m-%d}T00%3A00%3A00.000Z" in page.url
        begins = re.compile("The history begins at .*: the figures cover the .* since then")
        await expect(page.get_by_text(begins)).to_be_visible()
        shared = page.url
        await end.fill(f"{yesterday():%Y-%m-%d}T07:00")
        await expect(kind).to_have_value("given")
        await expect(finished).to_have_text("3")
        note = page.locator("nena-reports-page [role=status]")
        await start.fill(f"{yesterday():%Y-%m-%d}T07:30")
        await expect(note).to_have_text("The start must be before the end.")
        await expect(page.locator(".figures")).to_have_count(0)
        await start.fill("")
        await expect(note).to_have_text("Enter both times.")
        await start.fill("2020-01-01T00:00")
        await expect(note).to_have_text("A report covers at most 31 days.")
        await end.fill("2020-01-02T00:00")
        await expect(note).to_have_text("Nothing was recorded in this time range.")
        await page.goto("about:blank")
        await page.goto(shared)
        await expect(kind).to_have_value("given")
        await expect(finished).to_have_text("6")
        await page.goto("about:blank")
        await page.goto(f"{hall.url}#/reports?from=x&to=2020-01-01T00:00:00Z")
        await expect(kind).to_have_value("today")
        await page.goto("about:blank")
        await page.goto(link(hall, 8, 6))
        await expect(note).to_have_text("The start must be before the end.")


async def test_days_are_local_ones_when_clocks_change(hall: Hall, browser: Browser, tmp_path: Path) -> None:
    asked: list[dict[str, list[str]]] = []

    async def answer(route: Route) -> None:
        query = parse_qs(urlsplit(route.request.url).query)
        asked.append(query)
        start = datetime.fromisoformat(query["since"][0])
        hours = [
            {"since": (start + timedelta(hours=hour)).isoformat(), "finished": 1, "failed": 0}
            for hour in range(61)
        ]
        response = await route.fetch(url=f"{hall.url}api/v1/report")
        report = await response.json()
        report["recordedSince"] = query["since"][0]
        report["orders"]["hours"] = hours
        await route.fulfill(json=report)

    async with (
        hall.connected(*recorded_shift(tmp_path)),
        opened(browser, f"{hall.url}#/reports", timezone="Europe/Berlin") as page,
    ):
        await expect(page.locator("nena-reports-page [role=status]")).not_to_have_text("Loading …")
        await page.route("**/api/v1/report?*", answer)
        now = f"document.querySelector('nena-reports-page').store.now = () => {NOON_AFTER_CLOCKS_WENT_BACK}"
        await page.evaluate(now)
        await page.get_by_label("Time range").select_option("yesterday")
        rows = page.locator("nena-reports-page section:has(time) tbody tr")
        await expect(rows).to_have_count(3)
        assert asked[-1] == {"since": ["2026-10-24T22:00:00.000Z"], "until": ["2026-10-25T23:00:00.000Z"]}
        await expect(rows.first).to_contain_text("Sun")
        await expect(rows.first).to_contain_text("25")  # hours of that day
        await expect(rows.nth(1)).to_contain_text("24")


async def test_page_reports_a_missing_history(hall: Hall, browser: Browser) -> None:
    async with (
        hall.connected("--history.url", "none"),
        opened(browser, f"{hall.url}#/reports", expected=("404",)) as page,
    ):
        await expect(page.get_by_text("No history")).to_be_visible()
