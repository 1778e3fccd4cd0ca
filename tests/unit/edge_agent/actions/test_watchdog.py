"""What keeps a loop from running is seen; a loop that waits is none."""

from __future__ import annotations

import time

import pytest

from nena_edge_agent.actions.watchdog import LOOK_EVERY, LOOKS, Watchdog
from support.pausing import time_passes
from support.waiting import until


async def test_a_loop_that_waits_is_not_blocked() -> None:
    dog = Watchdog()
    for _ in range(LOOKS * 4):
        await time_passes(LOOK_EVERY / 2)
    dog.stop()

    assert dog.blocked == ""


@pytest.mark.filterwarnings("ignore")
async def test_a_loop_that_is_blocked_is_seen_with_the_place() -> None:
    dog = Watchdog()
    await until(lambda: dog._rounds > 1)
    end = time.monotonic() + 30.0
    while not dog.blocked and time.monotonic() < end:
        pass
    dog.stop()

    assert "test_a_loop_that_is_blocked_is_seen_with_the_place" in dog.blocked
    assert not dog.hangs.is_set()
