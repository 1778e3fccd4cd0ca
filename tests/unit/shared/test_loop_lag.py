from __future__ import annotations

import asyncio

from nena_shared.clock import SystemClock
from nena_shared.loop_lag import WINDOW, LoopLag
from support.clocks import ManualClock
from support.pausing import pass_time, turn_passes
from support.waiting import awaited


def test_the_longest_delay_of_the_last_minute_counts() -> None:
    clock = ManualClock()
    lag = LoopLag(clock)
    assert lag.longest == 0
    for delay in (0.1, 0.5, 0.2):
        lag.note(delay)
        clock.advance(20)
    assert lag.longest == 0.5
    clock.advance(WINDOW - 30)
    assert lag.longest == 0.2
    clock.advance(WINDOW)
    assert lag.longest == 0


async def test_work_that_holds_the_loop_is_noticed() -> None:
    lag = LoopLag(SystemClock())
    measuring = asyncio.create_task(lag.run())
    await turn_passes()
    pass_time(0.3)

    async def longest() -> float:
        return lag.longest

    assert await awaited(longest, lambda found: found > 0, what="the hold is noticed") > 0.15
    measuring.cancel()
