"""A hibernating robot is woken on its page."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, vehicle_idle
from support.panel import findings, opened

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

ROBOT = "#/robots/NeNa%2Frobot-01"
WAKE_UP = {"de-DE": "Aufwecken", "nl-NL": "Wekken"}
SLEEP = {
    "actionType": "startHibernation",
    "parameters": [{"key": "wakeUpTime", "value": "2100-01-01T00:00:00.000Z"}],
}


async def test_a_hibernating_robot_has_a_button_that_wakes_it(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    fleet = Fleet(broker, interface_name, tmp_path)
    port = free_port()
    url = f"http://127.0.0.1:{port}/{ROBOT}"
    with fleet.stack:
        async with await fleet.order_service("--engine.instant_action_timeout", 60).client() as orders:
            # started last: the plant names another version, which only a live message overrides
            content = fleet.agent_file(version="3.0.1")
            fleet.agent_of(content.replace("[loopback]", "[loopback]\npower = true"))
            options = [
                *("--http.port", str(port), "--mqtt.port", str(broker.port)),
                *("--interface_name", interface_name, "--interface_name_v3", interface_name),
                *("--topic_prefix", fleet.prefix, "--order_service.url", str(orders.base_url)),
            ]
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                await vehicle_idle(orders)
                async with opened(browser, url) as page:
                    wake = page.get_by_role("button", name="Wake up", exact=True)
                    await expect(page.get_by_role("button", name="Pause", exact=True)).to_be_visible()
                    await expect(wake).to_be_hidden()
                    slept = await orders.post("/v1/vehicles/Robot-01/instantActions", json=SLEEP)
                    assert slept.json()["status"] == "FINISHED"
                    await expect(wake).to_be_visible()
                    await expect(page.get_by_text("hibernating", exact=True)).to_be_visible()
                    assert await findings(page) == []
                    for language, name in WAKE_UP.items():
                        async with opened(browser, url, language=language) as other:
                            await expect(other.get_by_role("button", name=name, exact=True)).to_be_visible()

                    await wake.click()

                    await expect(page.get_by_text("Robot-01 is awake")).to_be_visible()
                    await expect(wake).to_be_hidden()
