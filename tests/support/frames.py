"""Frame rate of a page, and the processor time that it takes."""

from __future__ import annotations

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
"""Draws some frames in one turn, so that nothing else comes between them."""


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
"""Work like the map's, always the same: JSON and circles."""


async def frames_per_second(page: Page, seconds: float, *, move: bool) -> float:
    """Count the frames; with ``move`` the panel's map moves, so that nothing of it is kept."""
    counted: float = await page.evaluate(_FRAMES, {"seconds": seconds, "move": move})
    return counted


async def busy_clock(page: Page) -> CDPSession:
    """Make the browser measure the processor time of a page's main thread, see :func:`busy_seconds`."""
    session = await page.context.new_cdp_session(page)
    await session.send("Performance.enable", {"timeDomain": "threadTicks"})
    return session


async def busy_seconds(session: CDPSession) -> float:
    """Return the processor time that the page's main thread has used."""
    metrics = (await session.send("Performance.getMetrics"))["metrics"]
    return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))


async def seconds_for_a_frame(page: Page, session: CDPSession, frames: int = 60) -> float:
    """Return the processor time for drawing the panel's map while it moves."""
    before = await busy_seconds(session)
    drawn: int = await page.evaluate(_DRAW, frames)
    return (await busy_seconds(session) - before) / drawn


async def seconds_for_the_yardstick(page: Page, session: CDPSession) -> float:
    """Return the processor time for work that is always the same: how fast the machine is at the moment."""
    before = await busy_seconds(session)
    await page.evaluate(_YARDSTICK)
    return await busy_seconds(session) - before
