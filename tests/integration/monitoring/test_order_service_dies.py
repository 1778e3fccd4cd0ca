"""A real order service is killed, hangs and loses its database, and each time the right alert fires."""

from __future__ import annotations

import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pytest

from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, listening
from support.programs import OrderServiceProgram
from support.prometheus import Prometheus, eventually
from support.served_aggregator import serving
from support.waiting import awaited

pytestmark = pytest.mark.broker

FOUND_WITHIN = 60.0
"""Seconds from a fault to its alert on a loaded machine. By the settings it is at most 15: 7 of silence, 5
for which the alert has to hold, and here a second each for scrape and evaluation."""
FIRING = 'ALERTS{alertstate="firing"}'


@dataclass
class Site:
    """An aggregator and a Prometheus that watch an order service."""

    fleet: Fleet
    prefix: str
    port: int
    prometheus: Prometheus

    async def order_service(self) -> OrderServiceProgram:
        """Start it, and wait until it works."""
        program = OrderServiceProgram(
            *(self.prefix if each == self.fleet.prefix else each for each in self.fleet.arguments()),
            *("--http.port", self.port),
            log=self.fleet.folder / "order-service.log",
        )
        self.fleet.stack.enter_context(program)
        await listening(await program.client())
        return program

    async def firing(self) -> set[str]:
        """Return the alerts that fire."""
        return {each["metric"]["alertname"] for each in await self.prometheus.query(FIRING)}

    async def until_firing(self, *names: str) -> None:
        """Wait until exactly these alerts fire."""
        await awaited(
            self.firing,
            lambda now: now == set(names),
            seconds=FOUND_WITHIN,
            what=f"{names or 'no alert'} firing",
        )


@pytest.fixture
async def site(broker: Broker, interface_name: str, tmp_path: Path) -> AsyncIterator[Site]:
    async with _site(broker, interface_name, tmp_path) as made:
        yield made


@asynccontextmanager
async def _site(broker: Broker, interface_name: str, folder: Path) -> AsyncIterator[Site]:
    port = free_port()
    fleet = Fleet(broker, interface_name, folder)
    with fleet.stack:
        async with serving(broker, interface_name) as served:
            address = served.http.base_url.netloc.decode()
            async with Prometheus(folder, address, order_services=[f"127.0.0.1:{port}"]) as prometheus:
                yield Site(fleet, f"{interface_name}/nena", port, prometheus)


async def test_killed_order_service_and_its_return_are_detected(site: Site) -> None:
    first = await site.order_service()
    await eventually(partial(site.prometheus.query, "nena_order_service_up == 1"), "it is up")
    assert await site.firing() == set()

    first.kill()

    await site.until_firing("NenaOrderServiceDown")
    await site.order_service()
    await site.until_firing()


async def test_hanging_order_service_is_detected(site: Site) -> None:
    program = await site.order_service()
    await eventually(partial(site.prometheus.query, "nena_order_service_up == 1"), "it is up")

    program.process.send_signal(signal.SIGSTOP)
    try:
        await site.until_firing("NenaOrderServiceDown")
    finally:
        program.process.send_signal(signal.SIGCONT)
    await site.until_firing()


async def test_terminated_order_service_reports_its_end(site: Site) -> None:
    program = await site.order_service()
    await eventually(partial(site.prometheus.query, "nena_order_service_up == 1"), "it is up")

    program.process.send_signal(signal.SIGINT)

    down = "nena_order_service_up == 0"
    await eventually(partial(site.prometheus.query, down), down)
