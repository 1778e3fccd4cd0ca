"""Time jumps to what comes next, and nothing is lost on the way."""

from __future__ import annotations

import asyncio
import time
from datetime import timedelta

import pytest

from nena_shared.clock import Clock
from nena_simulate.virtual_time import BEGINNING, TimeStoodStillError, VirtualClock, run

HOUR = 3600.0


def test_long_wait_only_advances_the_clock() -> None:
    async def work(clock: VirtualClock) -> Clock:
        await asyncio.wait_for(asyncio.Event().wait(), timeout=8 * HOUR)
        return clock

    async def patient(clock: VirtualClock) -> Clock:
        try:
            return await work(clock)
        except TimeoutError:
            return clock

    begun = time.perf_counter()
    clock = run(patient)

    assert time.perf_counter() - begun < 5
    assert clock.monotonic() == pytest.approx(8 * HOUR, abs=0.01)
    assert abs(clock.now() - BEGINNING - timedelta(hours=8)) < timedelta(seconds=0.01)


def test_timers_fire_in_their_order() -> None:
    async def work(_: VirtualClock) -> list[int]:
        fired: list[int] = []
        loop, done = asyncio.get_running_loop(), asyncio.Event()
        for number in (3, 1, 2):
            loop.call_later(number, fired.append, number)
        loop.call_later(4, done.set)
        await done.wait()
        return fired

    assert run(work) == [1, 2, 3]


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
