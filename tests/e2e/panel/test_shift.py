"""A shift in a real browser: 50 robots in a hall of 300 points, and the tasks of an operator.

The order service is real; it locks the path, keeps the order, and is killed. The robots and their jam are
published by the test, on an interface that the order service does not listen to.
"""

from __future__ import annotations

import time
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from nena_shared.fleet_api.epoch import epoch_of, with_epoch
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import connection, position, state, vehicle_status
from support.order_service_fleet import Fleet, listening
from support.panel import COLOUR_NEAR, LABELS, becomes, findings, opened, picture, seconds_now
from support.plants import grid_name, grid_plant
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

COLUMNS, ROWS, ROBOTS, JAMMED = 20, 15, 50, 12
STOPPED = 17
TOLD_WITHIN = 2.0
"""Time until the page shows that the order service is down, with a margin for a busy machine, seconds."""
MAP = "document.querySelector('nena-fleet-map')"
NOTE_BANNER = """() => {
  const banner = document.querySelector("nena-link-banner");
  const look = () => {
    if (banner.textContent.includes("The order service is down")) window.told ??= Date.now();
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


@pytest.mark.parametrize(
    ("size", "dark"), [((1600, 1000), False), ((1280, 800), True)], ids=["light", "dark"]
)
async def test_a_shift(
    broker: Broker,
    interface_name: str,
    tmp_path: Path,
    browser: Browser,
    size: tuple[int, int],
    *,
    dark: bool,
) -> None:
    width, height = size
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
            )
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                topics = FleetTopics(fleet.prefix)
                told = await until(lambda: heard.payloads(topics.service_status), what="it lives")
                publish_robots(peer, TopicScheme(interface_name), topics, epoch_of(told[-1]))
                url = f"http://127.0.0.1:{port}/"
                async with opened(
                    browser, url, width=width, height=height, dark=dark, expected=("502",)
                ) as page:
                    await the_stopped_robot_is_seen(page)
                    await the_head_of_the_jam_is_two_clicks_away(page)
                    await the_order_is_found(page)
                    await is_locked(orders, await a_path_is_locked(page))
                    await page.get_by_role("link", name="All robots and orders").click()
                    if not dark:
                        await picture(page, "shift")
                    await page.evaluate(NOTE_BANNER)
                    killed = time.time()
                    service.kill()
                    await the_order_service_is_said_to_be_down(page, killed)


async def is_locked(orders: httpx.AsyncClient, path: str) -> None:
    async def locked() -> bool:
        paths = (await orders.get("/v1/paths")).json()["paths"]
        return any(each["locked"] for each in paths if each["name"] == path)

    await awaited(locked, bool, seconds=PATIENCE, what=f"{path} is locked")


async def the_order_service_is_said_to_be_down(page: Page, killed: float) -> None:
    banner = page.locator("nena-link-banner")
    await expect(banner).to_contain_text("The order service is down", timeout=1e3 * PATIENCE)
    took = await page.evaluate("window.told") / 1e3 - killed
    assert 0 < took < TOLD_WITHIN, f"told after {took:.1f} s"
    assert await findings(page) == []


async def the_stopped_robot_is_seen(page: Page) -> None:
    await expect(page.get_by_role("tab", name="Robots")).to_have_text(f"Robots ({ROBOTS})")
    row = page.locator(f"tr[data-robot='ACME/r{STOPPED}']")
    await expect(row).to_be_in_viewport()
    await expect(page.locator("tr[data-robot]").first).to_contain_text(f"AMR-{STOPPED}")
    await expect(page.get_by_role("link", name=f"AMR-{STOPPED}: Emergency stop")).to_be_in_viewport()
    await becomes(page, LABELS, None, lambda labels: any(f"AMR-{STOPPED}" in each for each in labels))


async def the_head_of_the_jam_is_two_clicks_away(page: Page) -> None:
    last = f"AMR-{STOPPED + JAMMED - 1}"
    await page.get_by_role("button", name=f"{JAMMED - 1} Waiting").click()
    row = page.locator("tr[data-robot]").filter(has_text=last).first
    await row.get_by_role("link", name=f"Head of queue: AMR-{STOPPED}").click()
    await expect(page.locator("nena-robot-page h2")).to_have_text(f"AMR-{STOPPED}")
    await page.go_back()
    await page.get_by_role("button", name=f"{JAMMED - 1} Waiting").click()


async def the_order_is_found(page: Page) -> None:
    await page.keyboard.press("/")
    await page.keyboard.type("WMS-042")
    await page.keyboard.press("Enter")
    await expect(page.locator("nena-order-page h2")).to_have_text("WMS-042")
    search = page.get_by_role("searchbox", name="Search")
    await search.fill("")


async def a_path_is_locked(page: Page) -> str:
    x, y = await page.evaluate(f"{MAP}.view.toScreen(31, 18)")  # between P-15-9 and P-16-9
    await page.locator("nena-fleet-map canvas").click(position={"x": x, "y": y})
    shown = page.locator("nena-place-page")
    await expect(shown.locator("h2")).to_contain_text("P-15-9")
    await page.get_by_role("button", name="Lock", exact=True).click()
    await expect(shown.locator(".chip")).to_have_text("Path, locked")
    await becomes(page, COLOUR_NEAR, [31, 18, "bad"], lambda found: found > 2)  # one of two directions
    return await shown.locator("h2").inner_text()
