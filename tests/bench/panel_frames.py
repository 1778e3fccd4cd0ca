"""Frames per second of the panel's map: 200 robots at 2 Hz, in Chromium, while the map is being moved."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from itertools import count
from typing import Any

from playwright.async_api import Page

from bench.browser import chromium
from bench.figures import Figures
from bench.pace import Pace
from bench.state_cost import publish
from bench.wire import Wire
from nena_demo.plants import sample_plant_path
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.plant.opentcs_xml import read
from support.frames import busy_clock, busy_seconds, frames_per_second, intervals_while_dragged
from support.waiting import awaited

ROBOTS = 200
RATE = 400.0
"""States per second: each robot sends two."""
RUNS = 3
LOOK_EVERY = 0.1
"""Seconds."""

_ROBOTS_SHOWN = "(wanted) => document.querySelector('nena-fleet-map').store?.robots.size >= wanted"


async def measure(port: int, url: str, seconds: float) -> dict[str, Any]:
    """Return the frames per second: map moved, dragged, at rest, and those of an empty page, the yardstick.

    Other work on the machine slows all of them down; ``moved_per_busy_second`` counts the frames per second
    of the page's own processor time instead.
    """
    wire = Wire(port, "bench-frames", ())
    plant = read(sample_plant_path().read_bytes()).model
    wire.publish(FleetTopics("nena/v1").plant_model, plant.to_json().encode(), retain=True)
    sending = asyncio.create_task(_send(wire), name="bench robots")
    async with chromium() as browser:
        page = await browser.new_page(viewport={"width": 1280, "height": 800})
        yardstick = await _frames(page, seconds, move=False)
        await page.goto(url)
        await awaited(
            lambda: page.evaluate(_ROBOTS_SHOWN, ROBOTS),
            bool,
            what="all robots on the panel",
            every=LOOK_EVERY,
        )
        clock = await busy_clock(page)
        before = await busy_seconds(clock)
        moved = await _frames(page, seconds, move=True)
        busy = await busy_seconds(clock) - before
        figures: Figures = {
            "moved": moved,
            "moved_per_busy_second": round(moved * seconds / busy, 1),
            "dragged_p5": await _slow_frames(page, seconds),
            "at_rest": await _frames(page, seconds, move=False),
            "empty_page": yardstick,
        }
    sending.cancel()
    with suppress(asyncio.CancelledError):
        await sending
    wire.close()
    return figures


async def _frames(page: Page, seconds: float, *, move: bool) -> float:
    """Return the median of some runs."""
    runs = [await frames_per_second(page, seconds / RUNS, move=move) for _ in range(RUNS)]
    return round(sorted(runs)[RUNS // 2], 1)


async def _slow_frames(page: Page, seconds: float) -> float:
    """Return the frames per second of the slowest twentieth of the frames while the mouse drags the map."""
    intervals = await intervals_while_dragged(page, seconds)
    return round(1 / intervals[int(0.95 * len(intervals))], 1)


async def _send(wire: Wire) -> None:
    pace = Pace(RATE)
    for number in count():
        publish(wire, number % ROBOTS, number // ROBOTS)
        await pace.kept(number + 1)
