"""The attention list in a real browser, and that panel, REST, metrics and `nena status` say the same."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, expect
from typer.testing import CliRunner

from nena_cli.__main__ import app
from nena_shared.fleet_api.stops import DirectStop, StopStatus
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.tasks import end
from nena_shared.vda5050.topics import Topic
from support.broker import free_port
from support.fleet_examples import connection, position, power, state, vehicle_status
from support.matters import OWN, SERVICES, Condition, emergency, heartbeat, key_of
from support.panel import Hall, becomes, findings, opened, picture, seconds_now
from support.panel_texts import Texts
from support.pausing import time_passes
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

AT_HOME = {"mobile_robot_position": position(3.0, 7.0)}
LIMITS = ("--jam.robots", "2", "--jam.seconds", "0.1")


class HallSite:
    """A hall as a site of :mod:`support.matters`, over MQTT."""

    def __init__(self, hall: Hall) -> None:
        self.hall = hall
        self._number = 0
        self._beat: dict[str, Any] | None = None

    @property
    def now(self) -> datetime:
        return datetime.now(UTC)

    def robot(self, name: str, vehicle: Mapping[str, Any] = MappingProxyType({}), **fields: Any) -> None:
        key = key_of(name)
        self._number += 1
        self.connection(name, "ONLINE")
        message = state(self._number, robot=key, at=seconds_now(), **fields)
        self.hall.send(Topic.STATE, message, robot=key)
        body = vehicle_status(name, robot=key, **vehicle).model_dump_json(by_alias=True)
        self.hall.peer.publish(self.hall.fleet.vehicle_status(key.serial_number), body, retain=True)

    def connection(self, name: str, state: str) -> None:
        self._number += 1
        key = key_of(name)
        self.hall.send(Topic.CONNECTION, connection(state, self._number, robot=key), robot=key, retain=True)

    def garble(self, name: str) -> None:
        self.hall.peer.publish(self.hall.robots.of(key_of(name), Topic.STATE), "not JSON")

    def order(self, name: str, state: TransportOrderState, **fields: Any) -> None:
        self._number += 1
        self.hall.publish_order(self._number, state, name, **fields)

    @asynccontextmanager
    async def beating(self) -> AsyncIterator[None]:
        """Repeat the last heartbeat of the order service, as it does itself."""

        async def beat() -> None:
            while True:
                await time_passes(1)
                if self._beat is not None:
                    self.service(**self._beat)

        task = asyncio.create_task(beat())
        yield
        await end(task)

    def service(self, **fields: Any) -> None:
        self._beat = fields
        body = heartbeat(self.now, **fields).model_dump_json(by_alias=True)
        self.hall.peer.publish(self.hall.fleet.service_status, body, retain=True)

    def direct_stop(self, stop: StopStatus) -> None:
        fields = stop.model_dump(include={"name", "by", "reason", "since"})
        body = DirectStop(**fields, user="anna").model_dump_json(by_alias=True)
        self.hall.peer.publish(self.hall.fleet.direct_stop(stop.name), body, retain=True)


ADVICE_IN_SIGHT = """() => {
  const frame = document.querySelector("nena-attention").getBoundingClientRect();
  const advice = document.querySelector("nena-attention li .advice").getBoundingClientRect();
  const list = document.querySelector("nena-attention");
  return advice.bottom <= Math.min(frame.bottom, innerHeight) && list.scrollWidth <= list.clientWidth;
}"""
"""Whether the advice of the first entry is in sight as a whole, and nothing is cut off at the side."""


async def nena_status(url: str) -> tuple[int, list[dict[str, Any]]]:
    """Run ``nena status``, without an order service; return its exit status and its list."""
    options = ("--json", "--aggregator", url, "--url", f"http://127.0.0.1:{free_port()}")
    done = await asyncio.to_thread(lambda: CliRunner().invoke(app, ["status", *options]))
    return done.exit_code, json.loads(done.stdout)["attention"]


def rows(page: Page) -> Any:
    return page.locator("nena-attention li")


@pytest.mark.parametrize("conditions", [OWN, *((each,) for each in SERVICES)], ids=lambda each: each[0].name)
async def test_panel_rest_metrics_and_nena_status_agree(
    hall: Hall, browser: Browser, conditions: tuple[Condition, ...]
) -> None:
    expected = {matter for condition in conditions for matter in condition.matters}
    site = HallSite(hall)
    async with (
        hall.connected(*LIMITS),
        site.beating(),
        httpx.AsyncClient(base_url=hall.url, timeout=PATIENCE) as client,
    ):
        for condition in conditions:
            condition.arrange(site)

        async def listed() -> list[dict[str, Any]]:
            found: list[dict[str, Any]] = (await client.get("api/v1/attention")).json()["attention"]
            return found

        matters = await awaited(
            listed, lambda found: {each["id"] for each in found} == expected, what="all conditions"
        )
        assert await nena_status(hall.url) == (1 if expected else 2, matters)
        metrics = (await client.get("metrics")).text
        counted = re.findall(r'nena_attention\{acknowledged="no",kind="\w+"\} (\d+)', metrics)
        assert sum(map(int, counted)) == len(matters) == len(expected)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await expect(page).to_have_title(f"({len(expected)}) NeNa" if expected else "NeNa")
            await page.locator("nena-attention-button button").click()
            await expect(rows(page)).to_have_count(len(expected))
            named = [each["subject"] for each in matters if each["subject"] and each["kind"] != "stop"]
            await expect(rows(page).locator(".name")).to_have_text(named)
            assert await findings(page, minor=True) == []
            for width in (1600, 1280, 390):
                await page.set_viewport_size({"width": width, "height": 900})
                await picture(page, f"attention-{conditions[0].name}-{width}")


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize(
    ("language", "count", "acknowledge", "known", "label"),
    [
        ("en-GB", "1 needs attention", "Acknowledge", "1 acknowledged", "Emergency stop"),
        ("de-DE", "1 Eingriff nötig", "Quittieren", "1 quittiert", "Not-Halt"),
        ("nl-NL", "1 ingreep nodig", "Bevestigen", "1 bevestigd", "Noodstop"),
    ],
)
async def test_matter_is_shown_acknowledged_and_ends(
    hall: Hall,
    browser: Browser,
    *,
    language: str,
    count: str,
    acknowledge: str,
    known: str,
    label: str,
    width: int,
) -> None:
    async with hall.connected():
        site = HallSite(hall)
        site.robot("Hit")
        async with opened(browser, hall.url, width=width, height=844, language=language) as page:
            await expect(page.locator("tr[data-robot]")).to_have_count(1)
            await expect(page).to_have_title("NeNa")
            site.robot("Hit", **emergency("MANUAL"))
            header = page.locator("nena-attention-button button")
            await expect(header).to_have_text(f"{count}: {label}: Hit")
            await expect(page).to_have_title("(1) NeNa")
            if width > 900:
                await header.click()
            row = rows(page)
            await expect(row).to_contain_text(label)
            await expect(row.get_by_role("link", name="Hit")).to_have_attribute("href", re.compile("robots"))
            assert await findings(page, minor=True) == []
            assert await page.evaluate(ADVICE_IN_SIGHT)
            button = row.get_by_role("button", name=acknowledge)
            await button.click()  # without a name, the field for it asks
            await page.keyboard.type("Anna")
            await button.click()
            await expect(row).to_contain_text("Anna")
            await expect(button).to_have_count(0)
            await expect(page).to_have_title("NeNa")
            await expect(header).to_have_text(f"{known}: {label}: Hit")
            await expect(header).to_have_attribute("data-urgent", "")  # it has not ended
            site.robot("Weak", **power(12.0))
            await expect(rows(page)).to_have_count(2)
            await expect(rows(page).first).to_contain_text("Hit")  # a warning never stands above it
            await picture(page, f"acknowledged-{width}-{language[:2]}")
            site.robot("Weak")
            site.robot("Hit")
            await expect(rows(page)).to_have_count(0)


@pytest.mark.parametrize("language", ["en-GB", "de-DE", "nl-NL"])
async def test_advice_names_the_charged_robot_that_takes_the_charger(
    hall: Hall, browser: Browser, language: str
) -> None:
    say = Texts(language)
    async with hall.connected():
        hall.publish_plant()
        site = HallSite(hall)
        site.robot("Weak", **power(12.0), **AT_HOME)
        async with opened(browser, hall.url, height=844, width=390, language=language) as page:
            await expect(rows(page)).to_contain_text(say("attention.advice.battery_low"))
            site.robot("Full", {"current_position": "Charging stand"}, **power(100.0), **AT_HOME)
            full = say("battery.charge", charge=100)
            await expect(rows(page)).to_contain_text(say("several.full", names=f"Full ({full})"))
            assert await page.evaluate(ADVICE_IN_SIGHT)
            await picture(page, f"charger-taken-{language[:2]}")


async def test_browser_notifies_of_what_is_new(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        site = HallSite(hall)
        site.robot("Old", **emergency("MANUAL"))
        async with opened(browser, hall.url) as page:
            await expect(page).to_have_title("(1) NeNa")
            await page.reload()  # to a page to which it is not new
            await page.evaluate(
                "() => { window.told = []; window.Notification = class { static permission = 'granted';"
                " constructor(title) { window.told.push(title); } }; }"
            )
            await expect(page).to_have_title("(1) NeNa")
            site.robot("New", **emergency("REMOTE"))
            await expect(page).to_have_title("(2) NeNa")
            await becomes(page, "window.told", None, ["New Emergency stop"].__eq__)


async def test_new_matter_sounds_once_if_switched_on(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        site = HallSite(hall)
        site.robot("Old", **emergency("MANUAL"))
        async with opened(browser, hall.url) as page:
            await page.add_init_script(
                "window.tones = 0; const { start } = OscillatorNode.prototype;"
                " OscillatorNode.prototype.start = function () { window.tones += 1; start.call(this); };"
            )
            await expect(page).to_have_title("(1) NeNa")
            await page.reload()
            await expect(page).to_have_title("(1) NeNa")
            await page.locator("nena-attention-button button").click()
            sound = page.locator("nena-attention").get_by_text("Sound", exact=True)
            await expect(sound).to_have_attribute("aria-pressed", "false")
            site.robot("Silent", **emergency("REMOTE"))
            await expect(page).to_have_title("(2) NeNa")
            assert await page.evaluate("tones") == 0
            await sound.click()
            await expect(sound).to_have_attribute("aria-pressed", "true")
            site.robot("Loud", **emergency("REMOTE"))
            await expect(page).to_have_title("(3) NeNa")
            # one when it was switched on, one for the new matter
            await becomes(page, "tones", None, lambda tones: tones == 2)

            await page.reload()  # a browser allows no sound until the page is used
            await expect(sound).to_have_attribute("aria-pressed", "true")
            site.robot("Unused", **emergency("REMOTE"))
            await expect(page).to_have_title("(4) NeNa")
            assert await page.evaluate("tones") == 0
            await page.locator("h1").click()
            site.robot("Used", **emergency("REMOTE"))
            await expect(page).to_have_title("(5) NeNa")
            await becomes(page, "tones", None, lambda tones: tones == 1)
