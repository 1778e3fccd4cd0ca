"""The attention list in a real browser, and that panel, REST, metrics and `nena status` say the same."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import Topic
from support.fleet_examples import connection, state, vehicle_status
from support.matters import OWN, emergency, heartbeat, key_of
from support.panel import Hall, findings, opened, picture, seconds_now
from support.waiting import awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

LIMITS = ("--jam.robots", "2", "--jam.seconds", "0.1")
ALL = {matter for condition in OWN for matter in condition.matters}


class HallSite:
    """A hall as a site of :mod:`support.matters`, over MQTT."""

    def __init__(self, hall: Hall) -> None:
        self.hall = hall
        self._number = 0

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

    def service(self, **fields: Any) -> None:
        body = heartbeat(self.now, **fields).model_dump_json(by_alias=True)
        self.hall.peer.publish(self.hall.fleet.service_status, body, retain=True)


def rows(page: Page) -> Any:
    return page.locator("nena-attention li")


async def test_panel_rest_and_metrics_agree_on_all_conditions(hall: Hall, browser: Browser) -> None:
    async with hall.connected(*LIMITS), httpx.AsyncClient(base_url=hall.url) as client:
        site = HallSite(hall)
        for condition in OWN:
            condition.arrange(site)

        async def listed() -> list[dict[str, Any]]:
            found: list[dict[str, Any]] = (await client.get("api/v1/attention")).json()["attention"]
            return found

        matters = await awaited(
            listed, lambda found: {each["id"] for each in found} == ALL, what="all conditions"
        )
        metrics = (await client.get("metrics")).text
        counted = re.findall(r'nena_attention\{acknowledged="no",kind="\w+"\} (\d+)', metrics)
        assert sum(map(int, counted)) == len(matters) == len(ALL)
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await expect(page).to_have_title(f"({len(ALL)}) NeNa")
            shown = page.get_by_role("button", name=re.compile(f"^{len(ALL)} need attention"))
            await shown.click()
            await expect(rows(page)).to_have_count(len(ALL))
            names = await rows(page).locator(".name").all_inner_texts()
            assert names == [each["subject"] for each in matters]
            assert await findings(page, minor=True) == []
            await picture(page, "attention")


@pytest.mark.parametrize("width", [1280, 390])
@pytest.mark.parametrize(
    ("language", "count", "acknowledge", "label"),
    [
        ("en-GB", "1 needs attention: Hit: Emergency stop", "Acknowledge", "Emergency stop"),
        ("de-DE", "1 Eingriff nötig: Hit: Not-Halt", "Quittieren", "Not-Halt"),
        ("nl-NL", "1 ingreep nodig: Hit: Noodstop", "Bevestigen", "Noodstop"),
    ],
)
async def test_matter_is_shown_acknowledged_and_ends(
    hall: Hall, browser: Browser, *, language: str, count: str, acknowledge: str, label: str, width: int
) -> None:
    async with hall.connected():
        site = HallSite(hall)
        site.robot("Hit")
        async with opened(browser, hall.url, width=width, height=844, language=language) as page:
            await expect(page.locator("tr[data-robot]")).to_have_count(1)
            await expect(page).to_have_title("NeNa")
            site.robot("Hit", **emergency("MANUAL"))
            header = page.locator("nena-attention-button button")
            await expect(header).to_have_text(count, timeout=5000)
            await expect(page).to_have_title("(1) NeNa")
            if width > 900:
                await header.click()
            (row,) = await rows(page).all()
            await expect(row).to_contain_text(label)
            await expect(row.get_by_role("link", name="Hit")).to_have_attribute("href", re.compile("robots"))
            assert await findings(page, minor=True) == []
            button = row.get_by_role("button", name=acknowledge)
            await button.click()  # without a name, the field for it asks
            await page.keyboard.type("Anna")
            await button.click()
            await expect(row).to_contain_text("Anna")
            await expect(button).to_have_count(0)
            await expect(page).to_have_title("NeNa")
            site.robot("Hit")
            await expect(rows(page)).to_have_count(0)


async def test_browser_notifies_of_what_is_new(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        site = HallSite(hall)
        site.robot("Old", **emergency("MANUAL"))
        async with opened(browser, hall.url) as page:
            await page.context.grant_permissions(["notifications"])
            await page.evaluate(
                "() => { window.told = []; window.Notification = class { static permission = 'granted';"
                " constructor(title) { window.told.push(title); } }; }"
            )
            await expect(page).to_have_title("(1) NeNa")
            site.robot("New", **emergency("REMOTE"))
            await expect(page).to_have_title("(2) NeNa")
            assert json.loads(await page.evaluate("JSON.stringify(window.told)")) == ["New Emergency stop"]
