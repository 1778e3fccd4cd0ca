"""Time jumps to what comes next, and nothing is lost on the way."""

from __future__ import annotations

import asyncio

import pytest

from nena_simulate.virtual_time import TimeStoodStillError, VirtualClock, run


def test_timer_shorter_than_the_clock_resolution_ends() -> None:
    async def work(clock: VirtualClock) -> float:
        loop, done = asyncio.get_running_loop(), asyncio.Event()
        end = 1e5 + 1e-12

        def look() -> None:
            left = end - clock.monotonic()
            if left > 0:
                loop.call_later(min(left, 1e5), look)
            else:
                done.set()

        look()
        await done.wait()
        return clock.monotonic()

    assert run(work) >= 1e5


def test_waiting_for_an_impossible_event_is_an_error() -> None:
    async def work(_: VirtualClock) -> None:
        await asyncio.Event().wait()

    with pytest.raises(TimeStoodStillError):
        run(work)


def test_thread_work_runs_immediately_and_reports_failures() -> None:
    async def work(_: VirtualClock) -> int:
        with pytest.raises(ZeroDivisionError):
            await asyncio.to_thread(lambda: 1 // 0)
        return await asyncio.to_thread(lambda: 7)

    assert run(work) == 7
