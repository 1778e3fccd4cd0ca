"""The panel over a real order service, with one loopback robot."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
from playwright.async_api import Browser, Page, expect

from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, vehicle_idle
from support.panel import opened, plan_shown
from support.programs import OrderServiceProgram, Program


@dataclass
class PanelSite:
    """The panel, and the programs behind it."""

    page: Page
    orders: httpx.AsyncClient
    order_service: OrderServiceProgram
    agent: Program


@asynccontextmanager
async def site(
    broker: Broker, interface_name: str, folder: Path, browser: Browser, *, expected: tuple[str, ...] = ()
) -> AsyncIterator[tuple[Page, httpx.AsyncClient]]:
    """Run a robot, an order service and an aggregator; yield the panel and a client of the order service."""
    async with panel_site(broker, interface_name, folder, browser, expected=expected) as made:
        yield made.page, made.orders


@asynccontextmanager
async def panel_site(
    broker: Broker, interface_name: str, folder: Path, browser: Browser, *, expected: tuple[str, ...] = ()
) -> AsyncIterator[PanelSite]:
    """Run a robot, an order service and an aggregator; yield them with the panel."""
    fleet, port = Fleet(broker, interface_name, folder), free_port()
    with fleet.stack:
        agent = fleet.agent()
        service = fleet.order_service()
        async with await service.client() as orders:
            await vehicle_idle(orders)
            options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
            addresses = ("--http.port", str(port), "--mqtt.port", str(broker.port))
            reached = ("--order_service.url", str(orders.base_url))
            with AggregatorProcess(*addresses, *options, *reached) as aggregator:
                await aggregator.logged("broker connected")
                async with opened(
                    browser, f"http://127.0.0.1:{port}/", width=1600, height=1000, expected=expected
                ) as page:
                    shown = page.locator("tr[data-robot]").filter(has_text="Robot-01")
                    await expect(shown).to_contain_text("Idle")
                    await plan_shown(page)
                    yield PanelSite(page, orders, service, agent)
