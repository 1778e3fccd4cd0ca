"""The guided tour of the demo in a real browser: the panel shows what each key causes."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, Page, expect

from support.demo import started
from support.panel import COLOUR_NEAR, becomes, opened, picture, visit

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.ros,
    pytest.mark.broker,
    pytest.mark.long,
    pytest.mark.timeout(480),
]


AISLE = [7.5, 8]
"""The middle of the aisle that is blocked, m."""


BESIDE = """(row) => {
  const [box, name] = [".mark", ".name"].map((each) => row.querySelector(each).getBoundingClientRect());
  return Math.abs(box.top - name.top) < name.height;
}"""


async def shows(page: Page, robot: str, condition: str) -> None:
    """Wait until the list shows a robot in a condition, beside its box."""
    row = page.locator(f'tr[data-robot="NeNa/{robot}"]')
    await expect(row.locator(".chip")).to_have_text(condition)
    assert await row.evaluate(BESIDE)


async def test_panel_shows_what_each_key_causes(browser: Browser, tmp_path: Path, domain_id: int) -> None:
    with started(tmp_path, domain_id, robots=10) as viewer:

        async def press(key: str, text: str) -> str:
            return await asyncio.to_thread(viewer.press, key, text)

        await asyncio.to_thread(viewer.read_until, " executing")
        async with opened(browser, viewer.panel, width=1600, height=1000) as page:
            await expect(page.locator("tr[data-robot]")).to_have_count(12)
            await picture(page, "tour-hall")

            await press("b", "blocked:")
            await becomes(page, COLOUR_NEAR, [*AISLE, "bad"], lambda found: found > 0)
            await picture(page, "tour-blocked-aisle")
            await press("b", "open again")

            await press("k", "killing the agent of AMR-10")
            await shows(page, "AMR-10", "Connection broken")
            await picture(page, "tour-killed-agent")
            await asyncio.to_thread(viewer.read_until, "AMR-10 is back")

            robot = (await press("e", "emergency stop of")).split()[6]
            await shows(page, robot, "Emergency stop")
            await picture(page, "tour-emergency-stop")
            await press("e", f"emergency stop of {robot} released")

            await press("o", "order service stopped")
            banner = page.locator("nena-link-banner")
            await expect(banner).to_have_attribute("data-level", "bad")
            await picture(page, "tour-order-service-stopped")
            await press("o", "order service is started again")
            await expect(banner).not_to_have_attribute("data-level", "bad")

            await press("p", "load peak")
            await expect(page.get_by_role("tab", name="Orders")).to_contain_text(re.compile(r"\([3-9]\d\)"))
            await page.get_by_role("tab", name="Orders").click()
            await picture(page, "tour-load-peak")

            await press("r", "#/history")
            await visit(page, f"{viewer.panel}#/history")
            await expect(page.locator("nena-history-page .history li").first).to_be_visible()
            await page.get_by_role("button", name="Play").click()
            await expect(page.get_by_role("button", name="Pause")).to_be_visible()
            await picture(page, "tour-replay")
        assert [line for line in viewer.lines if "FAILED" in line] == []
