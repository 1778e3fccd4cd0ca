"""The network between robots and broker is cut and slow: orders go on where they were."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from faults.extent import TIMES, WHOLE
from support.network import Line, line

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1200)]

DELAY, LOSS, RATE = 0.15, 0.05, 1e6
"""Seconds one way, share of frames, bit/s: a bad place of a wireless network."""


@pytest.fixture
def far() -> Iterator[Line]:
    with line() as made:
        yield made


async def test_cut_and_slow(trial: Callable[..., Any], far: Line) -> None:
    """Cut so that neither side hears of it, cut with the robots' own link down, then slow."""
    async with trial(seed=8, line=far) as running:
        for _ in range(TIMES):
            far.change(loss=1.0)
            await running.site.robots_are("CONNECTION_BROKEN")
            far.change(loss=0.0)
            await running.recovers("network silent")
            if WHOLE:
                far.down()
                await running.site.robots_are("CONNECTION_BROKEN")
                far.up()
                await running.recovers("robots' network down")
                far.change(delay=DELAY, loss=LOSS, rate=RATE)
                await running.recovers("network slow and lossy (meanwhile)")
                far.change(delay=0.0, loss=0.0, rate=float("inf"))
