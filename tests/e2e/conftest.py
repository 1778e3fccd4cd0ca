"""A real Chromium, and a simulated hall for the panel."""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator, Iterator

import pytest
from playwright.async_api import Browser, async_playwright

from support.broker import Broker, MqttPeer
from support.panel import Hall

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
async def browser() -> AsyncIterator[Browser]:
    """Return the installed Chromium; skip the test if it is not installed."""
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if chromium is None:
        pytest.skip("these tests need a real Chromium: apt-get install chromium")
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield browser
        await browser.close()


@pytest.fixture
def hall(broker: Broker, interface_name: str) -> Iterator[Hall]:
    """Return a hall with its own topics."""
    with MqttPeer(broker) as peer:
        yield Hall.of(broker, peer, interface_name)
