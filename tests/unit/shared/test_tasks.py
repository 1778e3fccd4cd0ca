from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest
from structlog.testing import capture_logs

from nena_shared.tasks import StartError, Supervisor, TaskFailedError, end, end_if_cancelled, forever
from support.pausing import turn_passes
from support.waiting import PATIENCE, until


async def nothing() -> None:
    pass


async def fail() -> None:
    raise RuntimeError("why")


async def endless() -> None:
    await asyncio.Event().wait()


async def test_stop_ends_the_wait_and_then_the_tasks() -> None:
    stop = asyncio.Event()
    async with Supervisor() as tasks:
        task = tasks.start("endless", endless())
        asyncio.get_running_loop().call_soon(stop.set)
        await asyncio.wait_for(tasks.wait(stop), PATIENCE)
        assert not task.done()

    assert task.cancelled()


@pytest.mark.parametrize("work", [fail, nothing])
async def test_vital_task_that_ends_in_any_way_ends_the_wait(work: object) -> None:
    with capture_logs() as logs:
        async with Supervisor() as tasks:
            tasks.start("the heart", fail() if work is fail else nothing())
            with pytest.raises(TaskFailedError, match="'the heart' has ended") as caught:
                await asyncio.wait_for(tasks.wait(asyncio.Event()), PATIENCE)

    assert caught.value.name == "the heart"
    assert [line["task"] for line in logs] == (["the heart"] if work is fail else [])


async def test_vital_task_that_says_what_to_do_is_logged_without_a_traceback() -> None:
    async def give_up() -> None:
        raise StartError("another one is active; restart this one")

    with capture_logs() as logs:
        async with Supervisor() as tasks:
            tasks.start("leadership", give_up())
            with pytest.raises(TaskFailedError):
                await asyncio.wait_for(tasks.wait(asyncio.Event()), PATIENCE)

    (line,) = logs
    assert line["reason"] == "another one is active; restart this one"
    assert "exc_info" not in line


@pytest.mark.provokes_failures
async def test_failure_of_other_tasks_is_logged_only() -> None:
    stop = asyncio.Event()
    with capture_logs() as logs:
        async with Supervisor() as tasks:
            tasks.start("helper", fail(), vital=False)
            await until(lambda: logs)
            stop.set()
            await asyncio.wait_for(tasks.wait(stop), PATIENCE)

    assert [(line["event"], line["task"]) for line in logs] == [("task failed", "helper")]
    assert str(logs[0]["exc_info"]) == "why"


async def forgetful(times: int, cleaned_up: list[str]) -> None:
    """Forget some cancellations, as ``asyncio.wait_for`` of Python 3.11 does at times."""
    try:
        while True:
            try:
                await endless()
            except asyncio.CancelledError:
                if not times:
                    raise
                times -= 1
    finally:
        cleaned_up.append("in order")


async def test_task_with_a_lost_cancellation_is_cancelled_again() -> None:
    cleaned_up: list[str] = []
    both = [asyncio.create_task(forgetful(times, cleaned_up)) for times in (0, 2)]
    broken = asyncio.create_task(fail())
    await turn_passes()
    await asyncio.wait_for(end(*both, broken, again_after=0.01), PATIENCE)

    assert all(each.cancelled() for each in both)
    assert cleaned_up == ["in order"] * 2
    assert both[0].cancelling() == 1
    assert both[1].cancelling() == 3


async def test_lost_cancellation_can_be_detected() -> None:
    async def forgets() -> None:
        end_if_cancelled()
        with suppress(asyncio.CancelledError):
            await endless()
        end_if_cancelled()
        pytest.fail("it goes on")

    task = asyncio.create_task(forgets())
    await turn_passes()
    task.cancel()
    await asyncio.wait({task}, timeout=PATIENCE)
    assert task.cancelled()


@pytest.mark.provokes_failures
async def test_forever_continues_after_a_failure() -> None:
    calls = 0
    third = asyncio.Event()

    async def work() -> None:
        nonlocal calls
        calls += 1
        if calls < 3:
            raise RuntimeError("why")
        third.set()
        await endless()

    with capture_logs() as logs:
        async with Supervisor() as tasks:
            tasks.start("poll", forever("poll", work, pause=0.001))
            await asyncio.wait_for(third.wait(), PATIENCE)

    assert [line["task"] for line in logs] == ["poll", "poll"]
