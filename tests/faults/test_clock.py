"""Clocks jump by hours, forth and back, while everything works: no message is taken for an old one for long.

The programs under test really see another time of day, from one reading to the next; durations stay true, as
they do when an NTP client sets a wrong clock.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from faults.extent import TIMES, only_in_whole
from faults.site import Site
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC
from support.shifted_clock import ShiftedClock
from support.waiting import until

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.timeout(1200), only_in_whole]

JUMPS = (timedelta(hours=3), timedelta(hours=-2), timedelta())
"""From the true time: forth, back by five hours, right again."""
NEAR = timedelta(minutes=30)


async def said_with(site: Site, shift: timedelta) -> None:
    """Wait until a robot has sent a timestamp with this shift: the fault is on the wire."""
    states = f"{site.interface}/v2/NeNa/loop-1/state"

    def look() -> bool:
        last = CODEC.decode(State, site.wire.received(states)[-1].payload)
        return abs(last.timestamp - datetime.now(UTC) - shift) < NEAR

    await until(look, timeout=60, what=f"robots say the time with {shift}")


async def test_of_robots(trial: Callable[..., Any], tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    async with trial(seed=11, robots_in=clock.environment) as running:
        for _ in range(TIMES):
            for shift in JUMPS:
                clock.jump_to(shift)
                await said_with(running.site, shift)
                await running.recovers("clocks of robots jump")


async def test_of_services(trial: Callable[..., Any], tmp_path: Path) -> None:
    clock = ShiftedClock(tmp_path)
    async with trial(seed=12, services_in=clock.environment) as running:
        for _ in range(TIMES):
            for shift in JUMPS:
                clock.jump_to(shift)
                await running.recovers("clocks of services jump")
