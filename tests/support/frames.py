"""Frame rate and CPU time of a page."""

from __future__ import annotations

import time
from itertools import pairwise
from math import sin
from statistics import median

from playwright.async_api import CDPSession, Page

_FRAMES = """({ seconds, move }) => new Promise((done) => {
  const map = document.querySelector("nena-fleet-map");
  const begin = performance.now();
  let frames = 0;
  const next = (now) => {
    if (now - begin > seconds * 1000) return done(frames / seconds);
    frames += 1;
    if (move) {
      map.view.pan(frames % 2 ? 1 : -1, 0);
      map.follow(false);
    }
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
})"""


_DRAW = """async (frames) => {
  const map = document.querySelector("nena-fleet-map");
  const real = window.requestAnimationFrame;
  let drawn = 0;
  while (drawn < frames) {
    await new Promise((turn) => real(turn));
    window.requestAnimationFrame = (draw) => {
      drawn += 1;
      draw(performance.now());
    };
    for (let each = 0; each < 10; each += 1) {
      map.view.pan(each % 2 ? 1 : -1, 0);
      map.follow(false);
    }
    window.requestAnimationFrame = real;
  }
  return drawn;
}"""
"""Draws some frames in one task, so that nothing else runs between them."""


_YARDSTICK = """() => {
  const context = new OffscreenCanvas(400, 300).getContext("2d");
  let found = 0;
  for (let round = 0; round < 300; round += 1) {
    const drawn = Array.from({ length: 200 }, (_, i) => ({ robot: `r${i}`, x: Math.sin(i + round) }));
    for (const each of JSON.parse(JSON.stringify(drawn))) {
      context.beginPath();
      context.arc(each.x * 100 + 200, 150, 5, 0, 7);
      context.fill();
      found += each.x;
    }
  }
  return found;
}"""
"""A fixed workload similar to the map's: JSON and circles."""


_COUNT_CALLS = """() => {
  const prototype = CanvasRenderingContext2D.prototype;
  window.canvasCalls = 0;
  for (const [name, { value }] of Object.entries(Object.getOwnPropertyDescriptors(prototype))) {
    if (typeof value !== "function" || name === "constructor") continue;
    prototype[name] = function (...values) {
      window.canvasCalls += 1;
      return value.apply(this, values);
    };
  }
}"""
"""Counts each call of a canvas from now on."""


_NOTE_FRAMES = """() => {
  window.frameTimes = [];
  const next = (now) => {
    if (now !== window.frameTimes.at(-1)) window.frameTimes.push(now); // twice in a frame of a late Firefox
    requestAnimationFrame(next);
  };
  requestAnimationFrame(next);
}"""
"""Notes the time of each frame from now on, ms."""

_NEXT_FRAME = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"

SWING = 100.0
"""How far the mouse drags the map to each side, px."""


async def frames_per_second(page: Page, seconds: float, *, move: bool) -> float:
    """Return the frames per second; with ``move`` the panel's map moves, so that nothing is cached."""
    counted: float = await page.evaluate(_FRAMES, {"seconds": seconds, "move": move})
    return counted


async def busy_clock(page: Page) -> CDPSession:
    """Let the browser measure the CPU time of a page's main thread, see :func:`busy_seconds`."""
    session = await page.context.new_cdp_session(page)
    await session.send("Performance.enable", {"timeDomain": "threadTicks"})
    return session


async def busy_seconds(session: CDPSession) -> float:
    """Return the CPU time of the page's main thread, seconds."""
    metrics = (await session.send("Performance.getMetrics"))["metrics"]
    return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))


async def seconds_for_a_frame(page: Page, session: CDPSession, frames: int = 60) -> float:
    """Return the CPU time for drawing the panel's map while it moves, seconds."""
    before = await busy_seconds(session)
    drawn: int = await page.evaluate(_DRAW, frames)
    return (await busy_seconds(session) - before) / drawn


async def seconds_for_the_yardstick(page: Page, session: CDPSession) -> float:
    """Return the CPU time of a fixed workload, as a measure of the machine's current speed, seconds."""
    before = await busy_seconds(session)
    await page.evaluate(_YARDSTICK)
    return await busy_seconds(session) - before


async def calls_per_frame(page: Page, frames: int = 20) -> float:
    """Return how often a frame of the moving map calls the canvas; the page counts from the first time on."""
    if not await page.evaluate("'canvasCalls' in window"):
        await page.evaluate(_COUNT_CALLS)
    before: int = await page.evaluate("window.canvasCalls")
    drawn: int = await page.evaluate(_DRAW, frames)
    after: int = await page.evaluate("window.canvasCalls")
    return (after - before) / drawn


async def intervals_while_dragged(page: Page, seconds: float) -> list[float]:
    """Drag the panel's map with the mouse; return the times between two frames, shortest first, seconds."""
    x, y = await _press_in_the_middle(page)
    await page.evaluate(_NOTE_FRAMES)
    began = time.monotonic()
    moves = 0
    while time.monotonic() - began < seconds:
        moves += 1
        await page.mouse.move(x + SWING * sin(moves / 15), y + SWING * sin(moves / 20))
    times: list[float] = await page.evaluate("window.frameTimes")
    await page.mouse.up()
    return sorted((after - before) / 1e3 for before, after in pairwise(times))


async def calls_per_dragged_frame(page: Page, frames: int = 20) -> float:
    """Return how often a frame calls the canvas while the mouse drags the map, after the first one."""
    x, y = await _press_in_the_middle(page)
    await page.mouse.move(x + SWING, y)
    await page.evaluate(_NEXT_FRAME)
    counts = [await page.evaluate("window.canvasCalls")]
    for each in range(frames):
        await page.mouse.move(x + SWING - 2 * each, y + each)
        await page.evaluate(_NEXT_FRAME)
        counts.append(await page.evaluate("window.canvasCalls"))
    await page.mouse.up()
    # news may be drawn in one of them
    return float(median(after - before for before, after in pairwise(counts)))


async def _press_in_the_middle(page: Page) -> tuple[float, float]:
    box = await page.locator("nena-fleet-map canvas").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    return x, y
