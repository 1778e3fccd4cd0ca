"""A real Chromium or Firefox, and a simulated hall for the panel."""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from playwright.async_api import Browser, async_playwright

from support.broker import Broker, MqttPeer
from support.panel import IN_FIREFOX, Hall

ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


@pytest.fixture
async def browser(tmp_path: Path) -> AsyncIterator[Browser]:
    """Return the installed Chromium, or Firefox with NENA_BROWSER=firefox; skip the test without it."""
    wanted = "firefox" if IN_FIREFOX else "chromium"
    program = shutil.which(wanted) or shutil.which(
        "firefox-esr" if wanted == "firefox" else "chromium-browser"
    )
    if program is None:
        pytest.skip(f"these tests need a real {wanted}: make {'firefox-test' if IN_FIREFOX else 'browser'}")
    async with async_playwright() as playwright:
        if IN_FIREFOX:  # the distribution's, by WebDriver BiDi
            browser = await playwright.firefox.launch(
                executable_path=program,
                channel="moz-firefox",
                firefox_user_prefs={"browser.download.folderList": 2, "browser.download.dir": str(tmp_path)},
            )
        else:
            browser = await playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        yield browser
        await browser.close()


@pytest.fixture
def hall(broker: Broker, interface_name: str) -> Iterator[Hall]:
    """Return a hall with its own topics."""
    with MqttPeer(broker) as peer:
        yield Hall.of(broker, peer, interface_name)
