"""Programs are killed, suspended and cut off; each time people learn of it once, and of nothing else."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from alerts.watched import SINGLE, Watch, WatchedSite, watched
from faults.site import SHORT_KEEP_ALIVE, Layout
from nena_shared.tasks import end
from support.network import Line, line
from support.pausing import time_passes
from support.prometheus import eventually

STOLEN, LEFT = 1.5, 1.0
"""Seconds without and with CPU."""

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(1200)]


@asynccontextmanager
async def killed(site: WatchedSite, name: str, start: Callable[[], object]) -> AsyncIterator[None]:
    """Kill a program, and start it again at the end."""
    site.programs[name].kill()
    yield
    start()


@asynccontextmanager
async def suspended(site: WatchedSite, name: str) -> AsyncIterator[None]:
    """Let a program hang."""
    process = site.programs[name].process
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.send_signal(signal.SIGCONT)


@asynccontextmanager
async def broker_killed(site: WatchedSite) -> AsyncIterator[None]:
    """Kill the broker, and start it again at the end."""
    site.broker.kill()
    yield
    site.broker.start()


async def test_killed_and_suspended_programs(tmp_path: Path) -> None:
    site = WatchedSite(tmp_path, Layout(loopback=3, singles=1))
    async with watched(site) as watch:
        await watch.finds(
            killed(site, "order-service", site.start_order_service),
            {"NenaOrderServiceDown": 1},
            severity="critical",
        )
        await watch.finds(
            killed(site, "aggregator", site.start_aggregator),
            {"NenaAggregatorDown": 1},
            instance=site.aggregator_address,
        )
        await watch.finds(
            killed(site, SINGLE, site.start_single_robot),
            {"NenaRobotGone": 1},
            serial_number=SINGLE,
            condition="BROKEN",
        )
        await watch.finds(suspended(site, "order-service"), {"NenaOrderServiceDown": 1})
        await watch.finds(broker_killed(site), {"NenaBrokerLinkLost": 2})


@asynccontextmanager
async def slowed_down(site: WatchedSite, name: str) -> AsyncIterator[None]:
    """Let a program get no CPU for more than a second, again and again."""
    process = site.programs[name].process

    async def pulse() -> None:
        while True:
            process.send_signal(signal.SIGSTOP)
            await time_passes(STOLEN)
            process.send_signal(signal.SIGCONT)
            await time_passes(LEFT)

    pulsing = asyncio.create_task(pulse())
    try:
        yield
    finally:
        await end(pulsing)
        process.send_signal(signal.SIGCONT)


async def test_slow_program(tmp_path: Path) -> None:
    site = WatchedSite(tmp_path, Layout(loopback=2, singles=1))
    async with watched(site, unhurried="none") as watch:
        await calm(watch)
        await watch.finds(
            slowed_down(site, "order-service"),
            {"NenaProgramSlow": 1},
            job="nena-order-service",
        )


async def calm(watch: Watch) -> None:
    """Wait until no program remembers a delay from its start."""
    calm = "count(nena_event_loop_lag_seconds > 1) or vector(0)"
    await eventually(lambda: watch.prometheus.query(f"({calm}) == 0"), calm)


class RemoteSite(WatchedSite):
    """A site with all robots behind a line, where Prometheus cannot reach them."""

    def targets(self) -> dict[str, Any]:
        """Return what Prometheus scrapes."""
        return {**super().targets(), "agents": ()}

    def _agent(self, serial: str, journal: Path | None = None) -> str:
        return super()._agent(serial, journal).replace(f"keep_alive = {SHORT_KEEP_ALIVE}", "keep_alive = 2")


@asynccontextmanager
async def cut(between: Line) -> AsyncIterator[None]:
    """Lose everything on a line, and nothing from the end on."""
    between.change(loss=1.0)
    yield
    between.change(loss=0.0)


async def test_robots_that_are_cut_off(tmp_path: Path) -> None:
    with line() as between:
        site = RemoteSite(tmp_path, Layout(loopback=3, singles=1, line=between))
        async with watched(site) as watch:
            await watch.finds(cut(between), {"NenaRobotGone": 4, "NenaFleetStands": 1})
