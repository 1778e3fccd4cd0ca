"""How often a page is drawn, and the processor time that it takes."""

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


async def frames_per_second(page: Page, seconds: float, *, move: bool) -> float:
    """Count the frames; with ``move`` the panel's map moves, so that nothing of it is kept."""
    counted: float = await page.evaluate(_FRAMES, {"seconds": seconds, "move": move})
    return counted


async def busy_clock(page: Page) -> CDPSession:
    """Have the browser measure the processor time of a page's main thread, see :func:`busy_seconds`."""
    session = await page.context.new_cdp_session(page)
    await session.send("Performance.enable", {"timeDomain": "threadTicks"})
    return session


async def busy_seconds(session: CDPSession) -> float:
    """Give the processor time that the page's main thread has used."""
    metrics = (await session.send("Performance.getMetrics"))["metrics"]
    return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))
