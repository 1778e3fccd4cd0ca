"""The control panel in a real browser, and a simulated hall that it shows."""

from __future__ import annotations

import asyncio
import json
import os
import re
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from axe_playwright_python.async_playwright import Axe  # type: ignore[import-untyped]
from playwright.async_api import Browser, Locator, Page, Route, expect

from nena_shared.fleet_api.peripherals import PeripheralStatus
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, MqttPeer, free_port
from support.fleet_examples import ROBOT, START, order_status, sample_plant
from support.robot_maps import robot_map
from support.waiting import PATIENCE, awaited

PICTURES = os.environ.get("NENA_SCREENSHOTS")
"""Folder for screenshots of the panel; unset: none are saved."""

IN_FIREFOX = os.environ.get("NENA_BROWSER") == "firefox"
"""Whether the browser is Firefox instead of Chromium."""


COLOUR_NEAR = """([x, y, colour]) => {
  const map = document.querySelector("nena-fleet-map");
  const [px, py] = map.view.toScreen(x, y).map((each) => Math.round(each * devicePixelRatio));
  const pixels = map.canvas.getContext("2d").getImageData(px - 4, py - 4, 9, 9).data;
  const wanted = map.colours[colour].match(/\\d+/g).map(Number);
  let count = 0;
  for (let at = 0; at < pixels.length; at += 4) {
    const off = wanted.reduce((sum, each, channel) => sum + Math.abs(each - pixels[at + channel]), 0);
    if (pixels[at + 3] > 60 && off < 40) count += 1;
  }
  return count;
}"""
"""Counts the pixels near a position of the plant that have a colour of the style sheet."""


LABELS = "() => (document.querySelector('nena-fleet-map').labels ?? []).map((each) => each.text)"
"""The labels on the map."""

OVERLAPPING = """() => {
  const labels = document.querySelector("nena-fleet-map").labels ?? [];
  const covers = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
  const pairs = labels.flatMap((one, at) => labels.slice(at + 1).map((other) => [one, other]));
  return pairs.filter((pair) => covers(pair[0].box, pair[1].box)).map((pair) => pair.map(({ text }) => text));
}"""
"""Pairs of labels on the map that overlap."""


PLAN_SHOWN = """() => {
  const { plant, view } = document.querySelector("nena-fleet-map");
  return Boolean(plant?.model) && view.width > 1;
}"""
"""Whether the map has a plan and a size."""


STYLE_OF_SCREENSHOTS = "YjaKGiklmzC6wjXA513HAMmzus8VE61XCOT+SmwNZWA="
"""Hash of the `body {}` that Playwright adds for a screenshot; Firefox reports that it blocks it."""

SIZES = {"wide": (1600, 1000), "laptop": (1280, 800), "phone": (390, 844)}
"""Sizes of windows, px."""

NARROW = 900
"""Up to this width the map is a tab, px."""

WITHIN = PATIENCE
"""Timeout for conditions in the page, seconds."""


AGE = timedelta(minutes=4)
"""Age of the orders in the hall."""

SILENCE_LIMIT = 3600.0
"""Seconds, longer than any test: most robots of the hall publish a state once and must not become silent."""


def seconds_now() -> float:
    """Return the seconds from the examples' start to now, so that robots' clocks are right."""
    return (datetime.now(UTC) - START).total_seconds()


@dataclass
class Hall:
    """Simulated robots and order service, and the aggregator that monitors them."""

    peer: MqttPeer
    port: int
    options: tuple[str, ...]
    robots: TopicScheme
    fleet: FleetTopics

    @classmethod
    def of(cls, broker: Broker, peer: MqttPeer, interface_name: str) -> Hall:
        """Create a hall with topics below ``interface_name``."""
        port = free_port()
        fleet = FleetTopics(f"{interface_name}/nena")
        addresses = ("--http.port", str(port), "--mqtt.port", str(broker.port))
        topics = ("--topic_prefix", fleet.prefix, "--interface_name", interface_name)
        limits = ("--silence_limit", str(SILENCE_LIMIT))
        return cls(peer, port, (*addresses, *topics, *limits), TopicScheme(interface_name), fleet)

    @property
    def url(self) -> str:
        """URL of the panel."""
        return f"http://127.0.0.1:{self.port}/"

    def send(self, topic: Topic, message: Header, *, robot: RobotKey = ROBOT, retain: bool = False) -> None:
        """Publish a message of a robot."""
        self.peer.publish(self.robots.of(robot, topic), CODEC.encode(message), retain=retain)

    def publish_plant(self) -> None:
        """Publish the sample plant, as the order service does."""
        self.peer.publish(self.fleet.plant_model, sample_plant().to_json(), retain=True)

    def publish_map(self) -> None:
        """Publish the map of the hall with its walls, as the edge agent of a robot does."""
        seen = robot_map(x=-1.0, y=-1.0, resolution=0.1, width=260, height=142)
        self.peer.publish(self.fleet.robot_map(ROBOT), seen.model_dump_json(by_alias=True), retain=True)

    def publish_order(
        self, version: int, state: TransportOrderState, name: str = "TO-1", **fields: Any
    ) -> None:
        """Publish the status of an order, as the order service does."""
        recent = {"created": datetime.now(UTC) - AGE, **fields}
        status = order_status(name, version, state, **recent).model_dump_json(by_alias=True)
        self.peer.publish(self.fleet.order_status(name), status, retain=True)

    def publish_peripheral(self, status: PeripheralStatus) -> None:
        """Publish the status of a device, as the order service does."""
        topic = self.fleet.peripheral(status.location, PeripheralTopic.STATUS)
        self.peer.publish(topic, status.model_dump_json(by_alias=True), retain=True)

    def aggregator(self, *options: str) -> AggregatorProcess:
        """Start the aggregator that monitors this hall."""
        return AggregatorProcess(*self.options, *options)

    @asynccontextmanager
    async def connected(self, *options: str) -> AsyncIterator[AggregatorProcess]:
        """Start the aggregator and wait until it is connected to the broker."""
        with self.aggregator(*options) as aggregator:
            await aggregator.logged("broker connected")
            yield aggregator


@asynccontextmanager
async def opened(
    browser: Browser,
    url: str,
    *,
    width: int = 1280,
    height: int = 800,
    dark: bool = False,
    language: str = "en-GB",
    timezone: str | None = None,
    touch: bool = False,
    expected: tuple[str, ...] = (),
) -> AsyncIterator[Page]:
    """Open the page; errors of the browser fail the test, except ``expected`` ones."""
    expect.set_options(timeout=1e3 * WITHIN)
    page = await browser.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if dark else "light",
        locale=language,
        timezone_id=timezone,
        has_touch=touch,
    )
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("console", lambda line: complaints.append(line.text) if line.type == "error" else None)
    page.on("dialog", lambda dialog: dialog.accept("Anna"))  # asks for the name of the person
    page.set_default_timeout(1e3 * WITHIN)
    await page.goto(url)
    yield page
    # the browsers report it while the aggregator is down, or asks for a login
    passed_over = ("net::ERR_", "establish a connection to the server", STYLE_OF_SCREENSHOTS, *expected)
    left = [each for each in complaints if not any(part in each for part in passed_over)]
    assert left == [], left
    await page.close()


async def becomes(page: Page, script: str, argument: Any, accept: Callable[[Any], bool]) -> Any:
    """Evaluate a script in the page until ``accept`` is true for its result.

    The page's content security policy allows nothing else.
    """
    return await awaited(lambda: page.evaluate(script, argument), accept, seconds=WITHIN, what=script)


async def plan_shown(page: Page) -> None:
    """Wait until the map shows the plan: it zooms to it, so that each place is at another one before."""
    await becomes(page, PLAN_SHOWN, None, bool)


async def visit(page: Page, url: str) -> None:
    """Open a view of the panel; in Firefox, ``goto`` waits in vain where only the fragment changes."""
    if "#" in url and url.partition("#")[0] == page.url.partition("#")[0]:
        await page.evaluate("(url) => { location.href = url; }", url)
    else:
        await page.goto(url)


async def fits(page: Page, width: int) -> None:
    """Wait until the page is no wider than ``width`` px."""
    await becomes(page, "document.documentElement.scrollWidth", None, lambda wide: wide <= width)


async def picture(page: Page, name: str) -> None:
    """Save a screenshot for the documentation, if a folder is set."""
    if PICTURES:
        await page.screenshot(path=Path(PICTURES) / f"{name}.png", animations="disabled")


COPY_BODIES = """() => {
  const real = window.fetch;
  window.fetch = (url, options) => {
    const headers = { ...options?.headers, "x-body": encodeURIComponent(options?.body ?? "") };
    return real(url, options?.body ? { ...options, headers } : options);
  };
}"""
"""Sends the body of a request as a header, too."""


async def answered(
    page: Page, requests: str | re.Pattern[str], answer: Callable[[Route, Any], Awaitable[None]]
) -> None:
    """Answer requests of the page by ``answer``, with what was sent: Playwright gets no body from Firefox."""
    if IN_FIREFOX:
        await page.evaluate(COPY_BODIES)

    async def handle(route: Route) -> None:
        sent = route.request
        body = unquote(sent.headers["x-body"]) if IN_FIREFOX else sent.post_data
        await answer(route, json.loads(body or ""))

    await page.route(requests, handle)


async def saved(page: Page, button: Locator, folder: Path) -> str:
    """Press a button that saves a file, and return its text.

    Of Firefox, Playwright notices only some and finds no file: it is in the ``folder`` of the browser.
    """
    if not IN_FIREFOX:
        async with page.expect_download() as download:
            await button.click()
        return (await (await download.value).path()).read_text(encoding="utf-8")
    await button.click()

    def text() -> str:  # it is empty at first
        return "".join(each.read_text(encoding="utf-8") for each in folder.glob("*.csv"))

    return await awaited(lambda: asyncio.to_thread(text), bool, seconds=WITHIN, what="the file is saved")


async def findings(page: Page, *, minor: bool = False) -> list[str]:
    """Return axe's serious and critical findings in a page; with ``minor``, all of them."""
    results = await Axe().run(page)
    return [
        f"{each['id']}: {json.dumps([node['html'] for node in each['nodes']])}"
        for each in results.response["violations"]
        if minor or each["impact"] in ("serious", "critical")
    ]
