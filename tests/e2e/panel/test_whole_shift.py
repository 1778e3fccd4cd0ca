"""A shift of fifty loopback robots and a real order service: what happens, is listed, and ends it."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Locator, Page, expect

from nena_shared.plant import PlantModel, Vehicle
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.order_service_fleet import Fleet, listening
from support.panel import LABELS, NARROW, SIZES, becomes, findings, fits, opened, picture
from support.panel_history import SLIDE
from support.panel_texts import Texts
from support.plants import GRID_MM, grid_name, grid_plant, path, point
from support.programs import OrderServiceProgram
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

LISTED_WITHIN = float(os.environ.get("NENA_LISTED_WITHIN", PATIENCE))
"""Time after which what happens must be in the list, seconds; 5 on a quiet machine (make test-all)."""
COLUMNS, ROWS, ROBOTS, DEAD_END = 20, 10, 50, 5
CUT_LABELS = """() => {
  const { labels, view } = document.querySelector("nena-fleet-map");
  return labels.filter(({ box }) => box[0] < 0 || box[2] > view.width).map(({ text }) => text);
}"""
AGENT = """
driver = "loopback"
interface_name = "{interface}"
map_id = "hall"
serial_number = "amr"
manufacturer = "NeNa"
[mqtt]
port = {port}
[journal]
folder = "{folder}"
[loopback]
count = {robots}
row = 10
spacing = 4
speed = 4.0
control = true
[interval]
state_maximum = 2.0
"""
"""Robots that say soon how much charge they have left."""


def hall() -> PlantModel:
    """Make a grid of aisles with a dead end, in which the second robot waits behind the first one."""
    grid = grid_plant(COLUMNS, ROWS)
    names = [grid_name(COLUMNS - 1, 0), *(f"End-{number}" for number in range(DEAD_END))]
    ends = [point(name, (COLUMNS + at) * GRID_MM, 0) for at, name in enumerate(names[1:])]
    pairs = [pair for a, b in pairwise(names) for pair in ((a, b), (b, a))]
    properties = {"vda5050:manufacturer": "NeNa", "vda5050:mapId": "hall", "vda5050:deviationXY": "0.5"}
    vehicles = [
        Vehicle(name=f"AMR-{number:02}", properties={**properties, "vda5050:serialNumber": f"amr-{number}"})
        for number in range(1, ROBOTS + 1)
    ]
    more = {"points": (*grid.points, *ends), "vehicles": tuple(vehicles)}
    return grid.model_copy(update={**more, "paths": (*grid.paths, *(path(" ".join(pair)) for pair in pairs))})


@dataclass
class Shift:
    """The page of an operator, and what happens in the hall."""

    page: Page
    orders: httpx.AsyncClient
    peer: MqttPeer
    interface: str
    say: Texts
    picture: str
    """How the names of the pictures begin."""
    took: dict[tuple[str, int], float] = field(default_factory=dict)
    """Seconds until a matter was in the list, by its kind and number."""

    @property
    def width(self) -> int:
        """Width of the window, px."""
        size = self.page.viewport_size
        assert size
        return size["width"]

    def control(self, number: int, **command: Any) -> None:
        """Do to a robot what a person in the hall does."""
        self.peer.publish(f"{self.interface}/loopback/NeNa/amr-{number}/control", json.dumps(command))

    async def order(self, name: str, number: int, place: str, **more: Any) -> None:
        stop = {"locationName": place, "operation": "MOVE"}
        body = {"name": name, "intendedVehicle": f"AMR-{number:02}", "destinations": [stop], **more}
        assert (await self.orders.post("/v1/transportOrders", json=body)).status_code == 201

    def entry(self, kind: str, subject: str = "") -> Locator:
        """Return the entry of a matter in the attention list."""
        return self.page.locator("nena-attention li").filter(has_text=self.say(kind)).filter(has_text=subject)

    async def appears(self, kind: str, subject: str = "") -> Locator:
        """Wait for a matter, note how long that takes, and look at the page."""
        begin = time.monotonic()
        entry = self.entry(kind, subject)
        await expect(entry).to_be_visible()
        self.took[kind, len(self.took)] = time.monotonic() - begin
        await self.check(f"{len(self.took)}-{kind.partition('.')[2]}")
        return entry

    async def check(self, name: str) -> None:
        """Fail if axe finds anything, or if the page is wider than the window; save a picture."""
        await picture(self.page, f"{self.picture}-{name}")
        assert await findings(self.page, minor=True) == [], name
        await fits(self.page, self.width)

    async def acknowledge(self, entry: Locator) -> None:
        """Say that one takes care of a matter, with one's name."""
        by = self.page.get_by_label(self.say("attention.as"))
        if not await by.input_value():
            await by.fill("Anna")
        await entry.get_by_role("button", name=self.say("attention.acknowledge")).click()
        await expect(entry).to_contain_text(self.say("attention.by", by="Anna"))

    async def back(self) -> None:
        """Leave a page for the lists."""
        await self.page.get_by_role("link", name=self.say("page.back")).click()

    async def ends(self, kind: str, subject: str = "") -> None:
        await expect(self.entry(kind, subject)).to_have_count(0)


SHIFTS = [
    pytest.param(size, language, marks=() if (size, language) == ("phone", "de-DE") else pytest.mark.long)
    for size in SIZES
    for language in ("en-GB", "de-DE", "nl-NL")
]


@pytest.mark.parametrize(("size", "language"), SHIFTS)
async def test_each_matter_is_listed_handled_and_replayed(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser, *, size: str, language: str
) -> None:
    fleet, port = Fleet(broker, interface_name, tmp_path), free_port()
    width, height = SIZES[size]
    plant = tmp_path / "hall.json"
    plant.write_text(hall().to_json())
    with fleet.stack, MqttPeer(broker) as peer:
        options = ("--plant", plant, "--http.port", free_port())
        service = fleet.order_service(*options)
        async with await service.client() as orders:
            await listening(orders)
            arguments = (
                *("--http.port", str(port), "--mqtt.port", str(broker.port), "--jam.robots", "1"),
                *("--interface_name", interface_name, "--topic_prefix", fleet.prefix, "--jam.seconds", "1"),
                *("--order_service.url", str(orders.base_url)),
                *("--history.url", f"sqlite:///{tmp_path}/history.db"),
            )
            with AggregatorProcess(*arguments) as aggregator:
                await aggregator.logged("broker connected")
                robots = AGENT.format(
                    interface=interface_name, port=broker.port, folder=tmp_path, robots=ROBOTS
                )
                fleet.agent_of(robots)
                url, down = f"http://127.0.0.1:{port}/", ("502", "503", "504")
                async with opened(
                    browser, url, language=language, expected=down, width=width, height=height
                ) as page:
                    named = f"whole-shift-{size}-{language[:2]}"
                    shift = Shift(page, orders, peer, interface_name, Texts(language), named)
                    tab = page.get_by_role("tab", name=shift.say("robots.tab", count=ROBOTS))
                    await expect(tab).to_be_visible()
                    idle = f"{ROBOTS} {shift.say('condition.IDLE')}"
                    await expect(page.locator("nena-fleet-summary")).to_contain_text(idle)
                    await a_low_battery_is_found_in_one_look(shift)
                    await a_robot_stands_in_a_dead_end(shift)
                    await an_order_fails_and_is_repeated(shift)
                    await a_path_is_locked(shift)
                    await the_order_service_hangs_and_dies(shift, service, fleet, options)
                    await the_shift_is_replayed(shift)
                    assert max(shift.took.values()) < LISTED_WITHIN, shift.took


async def a_low_battery_is_found_in_one_look(shift: Shift) -> None:
    shift.control(30, command="battery", stateOfCharge=12)
    header = shift.page.locator("nena-attention-button button")
    what = f"{shift.say('attention.battery_low')}: AMR-30"
    await expect(header).to_have_text(shift.say("attention.count.one", count=1, what=what))
    cut = await header.evaluate("(each) => each.scrollWidth - each.clientWidth")
    assert cut == 0, "the name and what it is are legible as a whole"
    await expect(header).to_be_in_viewport(ratio=1)
    await shift.check("one-look")
    await header.click()
    await shift.acknowledge(await shift.appears("attention.battery_low", "AMR-30"))
    shift.control(30, command="charging", charging=True)
    await shift.ends("attention.battery_low", "AMR-30")


async def a_robot_stands_in_a_dead_end(shift: Shift) -> None:
    page, say = shift.page, shift.say
    await shift.order("first", 10, f"End-{DEAD_END - 1}")

    async def driving() -> Any:
        return (await shift.orders.get("/v1/vehicles/AMR-10")).json()["currentPosition"]

    await awaited(driving, lambda place: str(place).startswith("End-"), what="AMR-10 is in the dead end")
    shift.control(10, command="emergencyStop", stop="MANUAL")
    await shift.acknowledge(await shift.appears("urgent.emergency_stop", "AMR-10"))
    for number in (9, 8, 20):
        await shift.order(f"behind-{number}", number, "End-0")
    entry = await shift.appears("attention.jam", "AMR-10")
    if shift.width <= NARROW:
        await page.get_by_role("tab", name=say("map.title")).click()
    await becomes(page, LABELS, None, lambda labels: any("AMR-10 (" in each for each in labels))
    assert await page.evaluate(CUT_LABELS) == []
    await shift.check("map")
    await entry.get_by_role("link", name="AMR-10").first.click()
    behind = page.locator("nena-queue")
    await expect(behind).to_contain_text("AMR-09")
    await behind.get_by_role("button", name=say("queue.reroute")).click()
    await expect(behind).to_contain_text(say("queue.noneRerouted"))
    await shift.check("queue")
    await shift.back()
    shift.control(10, command="acknowledgeEmergencyStop")
    await shift.ends("urgent.emergency_stop", "AMR-10")
    await shift.ends("attention.jam", "AMR-10")


async def an_order_fails_and_is_repeated(shift: Shift) -> None:
    page, say = shift.page, shift.say
    shift.control(50, command="pauseButton", pressed=True)
    await shift.order("WMS-7", 50, grid_name(0, 9), timeout=1)
    entry = await shift.appears("attention.order_failed", "WMS-7")
    await entry.get_by_role("link", name="WMS-7").click()
    await shift.check("order")
    await page.get_by_role("button", name=say("order.repeat"), exact=True).click()
    await expect(page.locator("nena-order-page")).to_contain_text(
        re.compile(say("done.orderCreated", name="WMS-7-.+"))
    )
    await shift.check("order-repeated")
    await shift.back()
    shift.control(50, command="pauseButton", pressed=False)
    await shift.acknowledge(entry.filter(has=page.get_by_text("WMS-7", exact=True)))


async def a_path_is_locked(shift: Shift) -> None:
    name = f"{grid_name(0, 0)} --- {grid_name(0, 1)}"
    answer = await shift.orders.put(f"/v1/paths/{name}/lock", json={"locked": True})
    assert answer.status_code < 300, answer.text
    entry = await shift.appears("attention.path_locked", name)
    await entry.get_by_role("button", name=shift.say("place.unlock")).click()
    await shift.ends("attention.path_locked", name)


async def the_order_service_hangs_and_dies(
    shift: Shift, service: OrderServiceProgram, fleet: Fleet, options: tuple[object, ...]
) -> None:
    service.process.send_signal(signal.SIGSTOP)
    await shift.acknowledge(await shift.appears("attention.order_service_down"))
    service.process.send_signal(signal.SIGCONT)
    await shift.ends("attention.order_service_down")
    service.kill()
    await shift.acknowledge(await shift.appears("attention.order_service_down"))
    async with await fleet.order_service(*options, name="again").client() as orders:
        await listening(orders)
    await shift.ends("attention.order_service_down")


async def the_shift_is_replayed(shift: Shift) -> None:
    page, say = shift.page, shift.say
    history = (await shift.page.request.get(f"{page.url.partition('#')[0]}api/v1/history?code=jam")).json
    (first, *_) = reversed((await history())["entries"])
    await page.get_by_role("link", name=say("order.history"), exact=True).click()
    await expect(page.get_by_role("button", name=say("history.play"), exact=True)).to_be_enabled()
    await page.evaluate(f"({SLIDE})(Date.parse('{first['time']}') + 200)")
    jams = "document.querySelector('nena-fleet-map').replayed.robots.filter(({ jam }) => jam).length"
    await becomes(page, jams, None, lambda found: found == 1)
    await shift.check("replay")
