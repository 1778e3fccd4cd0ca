from __future__ import annotations

import asyncio

import pytest
from structlog.testing import capture_logs

from nena_edge_agent.fleet import run_fleet
from nena_shared.tasks import StartError
from support.waiting import PATIENCE, until


class Robot:
    """Fails at its first ``failures`` starts, then runs until it is stopped."""

    def __init__(self, failures: int, error: Exception | None = None) -> None:
        self.starts = 0
        self.running = False
        self._failures = failures
        self._error = error or RuntimeError("a plug has come loose")

    def make(self) -> Robot:
        self.starts += 1
        return self

    async def run(self, stop: asyncio.Event) -> None:
        if self.starts <= self._failures:
            raise self._error
        self.running = True
        await stop.wait()
        self.running = False


@pytest.mark.parametrize("error", [StartError("the journal is damaged"), RuntimeError("a fault")])
async def test_a_failed_robot_is_restarted_and_the_others_continue(error: Exception) -> None:
    good, bad, stop = Robot(0), Robot(2, error), asyncio.Event()
    with capture_logs() as logs:
        fleet = asyncio.create_task(
            run_fleet({"good": good.make, "bad": bad.make}, stop, restarts=3, pause=0.01)
        )
        await until(lambda: bad.running)

    assert (good.starts, good.running, bad.starts) == (1, True, 3)
    assert [each["robot"] for each in logs if each["event"] == "robot failed"] == ["bad", "bad"]
    stop.set()
    await asyncio.wait_for(fleet, PATIENCE)
    assert not good.running


async def test_a_robot_that_keeps_failing_is_abandoned() -> None:
    good, hopeless, stop = Robot(0), Robot(100), asyncio.Event()
    with capture_logs() as logs:
        fleet = asyncio.create_task(
            run_fleet({"good": good.make, "hopeless": hopeless.make}, stop, restarts=2, pause=0.01)
        )
        await until(lambda: any("abandoned" in each["event"] for each in logs))

    assert (hopeless.starts, good.running) == (3, True)
    stop.set()
    await asyncio.wait_for(fleet, PATIENCE)


async def test_a_fleet_without_a_working_robot_ends() -> None:
    robots = {"a": Robot(100).make, "b": Robot(100).make}

    with capture_logs(), pytest.raises(StartError, match="no robot is running"):
        await asyncio.wait_for(run_fleet(robots, asyncio.Event(), restarts=1, pause=0.01), PATIENCE)


async def test_a_robot_that_cannot_be_created_counts_as_failed() -> None:
    good, stop = Robot(0), asyncio.Event()

    def damaged() -> Robot:
        message = "the journal is damaged"
        raise StartError(message)

    with capture_logs():
        fleet = asyncio.create_task(
            run_fleet({"damaged": damaged, "good": good.make}, stop, restarts=100, pause=0.01)
        )
        await until(lambda: good.running)
        stop.set()
        await asyncio.wait_for(fleet, PATIENCE)  # also while the other one waits for its next start

    assert not good.running


async def test_a_robot_that_was_shut_down_is_not_restarted_and_the_last_one_ends_the_program() -> None:
    class ShutDown(Robot):
        async def run(self, _: asyncio.Event) -> None:
            self.running = False

    first, second = ShutDown(0), ShutDown(0)
    robots = {"first": first.make, "second": second.make}

    await asyncio.wait_for(run_fleet(robots, asyncio.Event(), restarts=3, pause=0.01), PATIENCE)

    assert (first.starts, second.starts) == (1, 1)
