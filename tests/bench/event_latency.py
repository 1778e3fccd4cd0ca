"""A state on the wire until its event is at a client: 200 robots, 10 clients, one of them in Chromium."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Iterable, Iterator
from contextlib import AsyncExitStack
from typing import Any

import httpx
from playwright.async_api import Page

from bench.browser import chromium
from bench.figures import milliseconds
from bench.pace import Pace
from bench.state_cost import publish
from bench.wire import Wire
from support.pausing import time_passes

ROBOTS = 200
CLIENTS = 10
RATE = 200.0
"""States per second: each robot sends one."""

SETTLE_SECONDS = 2.0

Sent = dict[tuple[str, float], float]
"""When a state was published, by robot and its x; s since 1970, the clock that a page has too."""

_FOLLOW = """() => {
  window.seen = [];
  new EventSource("/api/v1/events").addEventListener("delta", (event) => {
    const now = (performance.timeOrigin + performance.now()) / 1000;
    for (const robot of JSON.parse(event.data).robots ?? []) {
      if (robot.position) window.seen.push([robot.id, robot.position.x, now]);
    }
  });
}"""


async def measure(port: int, url: str, seconds: float) -> dict[str, Any]:
    """Publish for ``seconds`` while clients follow; return the latencies at all of them, and at the page."""
    wire = Wire(port, "bench-latency", ())
    for number in range(ROBOTS):
        publish(wire, number, 0)
    sent: Sent = {}
    samples: list[float] = []
    async with AsyncExitStack() as stack:
        page = await _follow_in_browser(stack, url)
        readers = await _follow(stack, url, sent, samples)
        await time_passes(SETTLE_SECONDS)
        await _publish_states(wire, sent, seconds)
        await time_passes(SETTLE_SECONDS)
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
        in_browser = list(_of_page(await page.evaluate("() => window.seen"), sent))
    wire.close()
    return {**milliseconds([*samples, *in_browser]), "browser": milliseconds(in_browser)}


async def _follow_in_browser(stack: AsyncExitStack, url: str) -> Page:
    """Follow the stream in a page that draws nothing else."""
    browser = await stack.enter_async_context(chromium())
    page = await browser.new_page()
    await page.goto(f"{url}/healthz")
    await page.evaluate(_FOLLOW)
    return page


async def _follow(
    stack: AsyncExitStack, url: str, sent: Sent, samples: list[float]
) -> list[asyncio.Task[None]]:
    http = await stack.enter_async_context(httpx.AsyncClient(timeout=None))  # noqa: S113 - streams
    readers = []
    for _ in range(CLIENTS - 1):
        response = await stack.enter_async_context(http.stream("GET", f"{url}/api/v1/events"))
        readers.append(asyncio.create_task(_read(response, sent, samples), name="bench reader"))
    return readers


async def _publish_states(wire: Wire, sent: Sent, seconds: float) -> None:
    pace = Pace(RATE)
    for count in range(int(seconds * RATE)):
        number, header_id = count % ROBOTS, 1 + count // ROBOTS
        sent[(f"Bench/bench-{number:03d}", (header_id % 100) / 10)] = time.time()
        publish(wire, number, header_id)
        await pace.kept(count)


async def _read(response: httpx.Response, sent: Sent, samples: list[float]) -> None:
    event = ""
    async for line in response.aiter_lines():
        if line.startswith("event: "):
            event = line.removeprefix("event: ")
        elif line.startswith("data: ") and event == "delta":
            now = time.time()
            samples.extend(now - moment for moment in _moments(line, sent))


def _moments(line: str, sent: Sent) -> Iterator[float]:
    for robot in json.loads(line.removeprefix("data: ")).get("robots", ()):
        if (position := robot.get("position")) and (moment := sent.get((robot["id"], position["x"]))):
            yield moment


def _of_page(seen: Iterable[tuple[str, float, float]], sent: Sent) -> Iterator[float]:
    for robot, x, at in seen:
        if moment := sent.get((robot, x)):
            yield at - moment
