"""The traffic plan in a real browser: who holds what, who waits for whom, over a real order service."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import httpx
import pytest
from playwright.async_api import Browser, Page, expect

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.panel import COLOUR_NEAR, OVERLAPPING, becomes, opened, picture, visit
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

SLOW = 0.1
"""m/s, so that all stands as it is while the test looks at it."""


@dataclass
class Crossing:
    """Robot-02 comes along the middle aisle; Robot-01 waits on its way into it."""

    orders: httpx.AsyncClient
    url: str

    async def waiting(self) -> dict[str, Any]:
        """Wait until Robot-01 waits for Robot-02, and return its plan."""

        async def look() -> dict[str, Any]:
            plan = (await self.orders.get("/v1/traffic/plan")).json()
            (found,) = [each for each in plan["vehicles"] if each["vehicle"] == "Robot-01"]
            return cast("dict[str, Any]", found)

        def waits(plan: dict[str, Any]) -> bool:
            return bool(plan["wait"]) and plan["wait"]["vehicles"] == ["Robot-02"]

        return await awaited(look, waits, seconds=PATIENCE, what="Robot-01 waits for Robot-02")


@asynccontextmanager
async def crossing(broker: Broker, interface_name: str, folder: Path) -> AsyncIterator[Crossing]:
    fleet = Fleet(broker, interface_name, folder)
    port = free_port()
    with fleet.stack:
        async with await fleet.order_service().client() as orders:
            options = [
                *("--http.port", str(port), "--mqtt.port", str(broker.port)),
                *("--interface_name", interface_name, "--topic_prefix", fleet.prefix),
                *("--order_service.url", str(orders.base_url)),
            ]
            with AggregatorProcess(*options) as aggregator:
                await aggregator.logged("broker connected")
                # started last: the aggregator needs their first states, and the next ones take 30 s
                fleet.agent(speed=SLOW)
                fleet.agent("robot-02", x=15.0, y=7.0, speed=SLOW)
                for number, goal in ((2, "Middle 1"), (1, "Middle 3")):
                    await vehicle_idle(orders, f"Robot-0{number}")
                    to = {"destinations": [{"locationName": goal}], "intendedVehicle": f"Robot-0{number}"}
                    await orders.post("/v1/transportOrders", json={**to, "name": f"T-{number}"})
                    await order_in(orders, f"T-{number}", "BEING_PROCESSED")
                yield Crossing(orders, f"http://127.0.0.1:{port}/")


async def show(page: Page, layer: str, *, shown: bool) -> None:
    await page.get_by_role("checkbox", name=layer, exact=True).set_checked(shown)


async def test_traffic_plan_is_drawn_and_described(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with crossing(broker, interface_name, tmp_path) as hall, opened(browser, hall.url) as page:
        plan = await hall.waiting()
        await expect(page.locator("tr[data-robot]")).to_have_count(2)
        await page.get_by_label("Layers").click()
        for layer in ("Planned routes", "Goals", "Nav2 plans"):
            await show(page, layer, shown=False)
        await becomes(page, COLOUR_NEAR, [6.5, 2, "busy"], lambda found: found == 0)
        await show(page, "Traffic plan", shown=True)

        await becomes(page, COLOUR_NEAR, [6.5, 2, "busy"], lambda found: found > 20)  # Robot-01 holds South 2
        await becomes(page, COLOUR_NEAR, [9, 7, "bad"], lambda found: found > 5)  # and waits for Middle 2
        await page.get_by_label("Layers").click()
        assert await page.evaluate(OVERLAPPING) == []
        await picture(page, "traffic-plan")

        await visit(page, f"{hall.url}#/robots/NeNa%2Frobot-01")
        await expect(page.locator("nena-robot-page")).to_contain_text(plan["wait"]["reason"])
        await page.get_by_label("Layers").click()
        await show(page, "Traffic plan", shown=False)
        await becomes(page, COLOUR_NEAR, [9, 7, "bad"], lambda found: found == 0)
