"""A shift in a real browser: 50 robots in a hall of 300 points, and the tasks of an operator.

The order service is real; it locks the path, keeps the order, and is killed. The robots and their jam are
published by the test, on an interface that the order service does not listen to.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.epoch import epoch_of, with_epoch
from nena_shared.fleet_api.service_status import LOST_AFTER
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import connection, position, state, vehicle_status
from support.order_service_fleet import Fleet, listening
from support.panel import (
    COLOUR_NEAR,
    LABELS,
    NARROW,
    SILENCE_LIMIT,
    SIZES,
    becomes,
    findings,
    fits,
    opened,
    picture,
    plan_shown,
    seconds_now,
)
from support.panel_history import recorded_shift
from support.panel_texts import Texts
from support.plants import grid_name, grid_plant
from support.programs import OrderServiceProgram
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

COLUMNS, ROWS, ROBOTS, JAMMED = 20, 15, 50, 12
STOPPED = 17
TOLD_WITHIN = LOST_AFTER
"""Time after which missing heartbeats would tell it as well as the last will, seconds."""
MAP = "document.querySelector('nena-fleet-map')"
NOTE_BANNER = """(words) => {
  const banner = document.querySelector("nena-link-banner");
  const look = () => {
    if (banner.textContent.includes(words)) window.told ??= Date.now();
  };
  new MutationObserver(look).observe(banner, { childList: true, characterData: true, subtree: true });
}"""
"""Notes the time at which the banner appears, so that the polling interval of the test does not matter."""


def publish_robots(peer: MqttPeer, robots: TopicScheme, fleet: FleetTopics, epoch: int) -> None:
    """Publish AMR-17 with an emergency stop, eleven robots that wait behind it, and idle ones."""
    for number in range(1, ROBOTS + 1):
        key, name = RobotKey("ACME", f"r{number:02}"), f"AMR-{number:02}"
        stopped = number == STOPPED
        before = number - 1 if STOPPED < number < STOPPED + JAMMED else None
        here = position(2 * (number % COLUMNS), 2 * (number // COLUMNS) * 5)
        safety = {"active_emergency_stop": "MANUAL" if stopped else "NONE", "field_violation": False}
        sent = state(robot=key, at=seconds_now(), mobile_robot_position=here, safety_state=safety)
        peer.publish(robots.of(key, Topic.CONNECTION), CODEC.encode(connection(robot=key)), retain=True)
        peer.publish(robots.of(key, Topic.STATE), CODEC.encode(sent))
        wait = before and TrafficWait(
            vehicles=(f"AMR-{before:02}",), at="P-3-5", cause=WaitCause.PASSES, reason="the other goes first"
        )
        order = f"T-{number}" if wait else None
        status = vehicle_status(name, robot=key, transport_order=order, wait=wait or None)
        body = with_epoch(status.model_dump_json(by_alias=True).encode(), epoch)
        peer.publish(fleet.vehicle_status(key.serial_number), body, retain=True)


IN_CI = {("wide", "light", "en-GB"), ("laptop", "dark", "de-DE"), ("phone", "light", "nl-NL")}
"""Each size, theme and language once; the other combinations are long tests."""
SHIFTS = [
    pytest.param(size, theme, language, marks=() if (size, theme, language) in IN_CI else pytest.mark.long)
    for size in SIZES
    for theme in ("light", "dark")
    for language in ("en-GB", "de-DE", "nl-NL")
]


@dataclass
class Screen:
    """The page, its texts and whether it is narrow."""

    page: Page
    say: Texts
    size: str
    theme: str

    @property
    def narrow(self) -> bool:
        """Whether the map is a tab."""
        return SIZES[self.size][0] <= NARROW

    async def check(self, name: str) -> None:
        """Fail if axe finds anything, or if the page is wider than the screen; save a picture."""
        assert await findings(self.page, minor=True) == [], name
        await fits(self.page, SIZES[self.size][0])
        await picture(self.page, f"shift-{self.size}-{self.theme}-{name}")

    async def back(self) -> None:
        """Leave a page for the lists."""
        await self.page.get_by_role("link", name=self.say("page.back")).click()


@pytest.mark.parametrize(("size", "theme", "language"), SHIFTS)
async def test_a_shift(
    broker: Broker,
    interface_name: str,
    tmp_path: Path,
    browser: Browser,
    *,
    size: str,
    theme: str,
    language: str,
) -> None:
    width, height = SIZES[size]
    fleet, port = Fleet(broker, f"{interface_name}-orders", tmp_path), free_port()
    plant = tmp_path / "plant.json"
    plant.write_text(grid_plant(COLUMNS, ROWS).to_json())
    with fleet.stack, MqttPeer(broker) as peer:
        heard = fleet.peer()
        service = fleet.order_service("--plant", plant)
        async with await service.client() as orders:
            await listening(orders)
            stop = {"locationName": grid_name(9, 9), "operation": "MOVE"}
            body = {"name": "WMS-042", "destinations": [stop]}
            assert (await orders.post("/v1/transportOrders", json=body)).status_code == 201
            options = (
                *("--http.port", str(port), "--mqtt.port", str(broker.port)),
                *("--interface_name", interface_name, "--topic_prefix", fleet.prefix),
                *("--order_service.url", str(orders.base_url), "--jam.seconds", "0.1"),
                *("--silence_limit", str(SILENCE_LIMIT)),
                *recorded_shift(tmp_path),
            )
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                topics = FleetTopics(fleet.prefix)
                told = await until(lambda: heard.payloads(topics.service_status), what="it lives")
                publish_robots(peer, TopicScheme(interface_name), topics, epoch_of(told[-1]))
                url = f"http://127.0.0.1:{port}/"
                async with opened(
                    browser,
                    url,
                    width=width,
                    height=height,
                    dark=theme == "dark",
                    language=language,
                    timezone="UTC",
                    expected=("502",),
                ) as page:
                    await tasks_of_a_shift(Screen(page, Texts(language), size, theme), orders, service)


async def tasks_of_a_shift(screen: Screen, orders: httpx.AsyncClient, service: OrderServiceProgram) -> None:
    """Do what an operator does, up to the death of the order service."""
    await the_stopped_robot_is_seen(screen)
    await the_head_of_the_jam_is_two_clicks_away(screen)
    await the_order_is_found(screen)
    await is_locked(orders, await a_path_is_locked(screen))
    await an_area_is_stopped_and_released(screen, orders)
    await yesterdays_report_is_read(screen)
    await screen.back()
    if screen.size == "wide":  # the list fills its room again
        await expect(screen.page.locator("tr[data-robot='ACME/r26']")).to_be_in_viewport()
        await picture(screen.page, "shift" if screen.theme == "light" else "shift-dark")
    await screen.page.evaluate(NOTE_BANNER, screen.say.start("link.orderService"))
    killed = time.time()
    service.kill()
    await the_order_service_is_said_to_be_down(screen, killed)


async def is_locked(orders: httpx.AsyncClient, path: str) -> None:
    async def locked() -> bool:
        paths = (await orders.get("/v1/paths")).json()["paths"]
        return any(each["locked"] for each in paths if each["name"] == path)

    await awaited(locked, bool, seconds=PATIENCE, what=f"{path} is locked")


async def the_order_service_is_said_to_be_down(screen: Screen, killed: float) -> None:
    banner = screen.page.locator("nena-link-banner")
    await expect(banner).to_contain_text(screen.say.start("link.orderService"), timeout=1e3 * PATIENCE)
    took = await screen.page.evaluate("window.told") / 1e3 - killed
    assert 0 < took < TOLD_WITHIN, f"told after {took:.1f} s"
    await screen.check("down")


async def the_stopped_robot_is_seen(screen: Screen) -> None:
    page, say = screen.page, screen.say
    tab = page.get_by_role("tab", name=say.start("robots.tab"))
    await expect(tab).to_have_text(say("robots.tab", count=ROBOTS))
    await expect(page.locator("tr[data-robot]").first).to_contain_text(f"AMR-{STOPPED}")
    if screen.narrow:
        needs = page.get_by_role("region", name=say("attention.title"))
        await expect(needs.get_by_role("link", name=f"AMR-{STOPPED}").first).to_be_in_viewport()
    else:
        await expect(page.locator(f"tr[data-robot='ACME/r{STOPPED}']")).to_be_in_viewport()
        needs = page.locator("nena-attention-button")
        await expect(needs).to_contain_text(f"{say('urgent.emergency_stop')}: AMR-{STOPPED}")
        await becomes(page, LABELS, None, lambda labels: any(f"AMR-{STOPPED}" in each for each in labels))
    await screen.check("lists")


async def the_head_of_the_jam_is_two_clicks_away(screen: Screen) -> None:
    page, say = screen.page, screen.say
    last = f"AMR-{STOPPED + (2 if screen.narrow else JAMMED - 1)}"  # on a phone, one that is in sight
    waiting = page.get_by_role("button", name=f"{JAMMED - 1} {say('condition.WAITING.many')}")
    await waiting.click()
    row = page.locator("tr[data-robot]").filter(has_text=last).first
    head = say("robots.head", name=f"AMR-{STOPPED}", condition=say("urgent.emergency_stop"))
    await row.get_by_role("link", name=head).click()
    await expect(page.locator("nena-robot-page h2")).to_have_text(f"AMR-{STOPPED}")
    await screen.check("head")
    await page.go_back()
    await waiting.click()


async def the_order_is_found(screen: Screen) -> None:
    page = screen.page
    await page.keyboard.press("/")
    await page.keyboard.type("WMS-042")
    await page.keyboard.press("Enter")
    await expect(page.locator("nena-order-page h2")).to_have_text("WMS-042")
    await screen.check("order")
    await page.get_by_role("searchbox", name=screen.say("search.label")).fill("")  # back to the lists


async def a_path_is_locked(screen: Screen) -> str:
    page, say = screen.page, screen.say
    canvas = page.locator("nena-fleet-map canvas")
    if screen.narrow:
        await page.get_by_role("tab", name=say("map.title")).click()
        await plan_shown(page)
        await canvas.focus()
        for _ in range(4):  # the middle of the hall stays where it is
            await page.keyboard.press("+")
    x, y = await page.evaluate(f"{MAP}.view.toScreen(19, 14)")  # between P-9-7 and P-10-7
    await canvas.click(position={"x": x, "y": y})
    shown = page.locator("nena-place-page")
    await expect(shown.locator("h2")).to_contain_text("P-9-7")
    await page.get_by_role("button", name=say("place.lock"), exact=True).click()
    await expect(shown.locator(".chip")).to_have_text(say("place.locked"))
    await becomes(page, COLOUR_NEAR, [19, 14, "bad"], lambda found: found > 2)  # one of two directions
    await screen.check("path")
    return await shown.locator("h2").inner_text()


async def an_area_is_stopped_and_released(screen: Screen, orders: httpx.AsyncClient) -> None:
    page, say = screen.page, screen.say
    await page.get_by_role("button", name=say("stops.area"), exact=True).click()
    form = page.get_by_role("form", name=say("stops.area"))
    await form.get_by_label(say("stops.by")).fill("Anna")
    await form.get_by_label(say("stops.reason")).fill("oil on the floor")
    for name, value in {"xMin": 3, "yMin": 3, "xMax": 9, "yMax": 9}.items():
        await form.get_by_label(say(f"stops.{name}")).fill(str(value))
    await screen.check("area-form")
    await form.get_by_role("button", name=say("stops.area.send")).click()
    banner = page.locator("nena-stops .stop")
    await expect(banner).to_contain_text("oil on the floor")
    await expect(banner).to_contain_text(say("stops.area.none"))
    (stop,) = (await orders.get("/v1/stops")).json()["stops"]
    assert (stop["by"], stop["area"]["xMax"]) == ("Anna", 9)
    await screen.check("area")
    await banner.get_by_role("button", name=say("stops.end")).click()
    await banner.get_by_label(say("stops.reason")).fill("clean again")
    await banner.get_by_role("button", name=say("stops.end.send")).click()
    await expect(banner).to_have_count(0)
    assert (await orders.get("/v1/stops")).json()["stops"] == []


async def yesterdays_report_is_read(screen: Screen) -> None:
    page, say = screen.page, screen.say
    await page.get_by_role("link", name=say("reports.title"), exact=True).click()
    await page.get_by_label(say("period.range")).select_option("yesterday")
    finished = page.locator(".figures > div").filter(has_text=say("reports.finished")).locator("dd")
    await expect(finished).to_have_text("6")
    await screen.check("report")
