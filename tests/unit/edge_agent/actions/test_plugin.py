from __future__ import annotations

import asyncio

from nena_edge_agent.actions.plugin import ENDED, BackgroundAction, Countdown, RunningAction, WorkFailedError
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from support.ready_made import end_of
from support.waiting import until

FINISHED = ActionReport("a", ActionStatus.FINISHED, "done")


class Trial:
    def __init__(self, step: str = "") -> None:
        self.reports: list[ActionReport] = []
        self.begun, self.free = asyncio.Event(), asyncio.Event()
        self.step = step
        self.action = BackgroundAction("a", self.work, self.reports.append)

    async def work(self) -> ActionReport:
        if self.step == "fail":
            message = "no power"
            raise WorkFailedError(message)
        if self.step == "raise":
            raise OSError(self.step)
        self.begun.set()
        try:
            await self.free.wait()
        except asyncio.CancelledError:
            self.reports.append(ActionReport("a", ActionStatus.RUNNING, "puts things right"))
            raise
        return FINISHED

    async def end(self) -> ActionReport:
        return await end_of(self.reports)


async def test_it_ends_as_its_coroutine_does() -> None:
    trial = Trial()
    trial.free.set()

    assert await trial.end() is FINISHED
    assert (await Trial("fail").end()).result == "no power"
    assert (await Trial("raise").end()).result == "the plug-in failed: raise"


async def test_a_cancelled_action_cleans_up_first() -> None:
    trial = Trial()
    await until(trial.begun.is_set)
    trial.action.cancel()
    assert not trial.action.ended

    assert (await trial.end()).result == "cancelled"
    assert trial.reports[-2].result == "puts things right"


async def test_an_action_cancelled_before_its_start_reports_it_too() -> None:
    trial = Trial()
    trial.action.cancel()

    assert (await trial.end()).result == "cancelled"
    assert trial.action.ended


async def test_an_ended_action_cannot_be_changed() -> None:
    reports: list[ActionReport] = []
    ends: list[str] = []
    countdown = Countdown("a", 0.01, reports.append, lambda: ends.append("over"))
    countdown.start()
    await until(lambda: ends)
    for step in (countdown.pause, countdown.resume, countdown.cancel):
        step()

    assert [each.status.value for each in reports] == ["RUNNING"]


async def test_it_is_cancelled_once() -> None:
    reports: list[ActionReport] = []
    countdown = Countdown("a", float("inf"), reports.append, lambda: None)
    countdown.start()
    countdown.pause()
    countdown.cancel()
    countdown.cancel()
    countdown.resume()

    assert [each.status.value for each in reports] == ["RUNNING", "PAUSED", "FAILED"]


def test_an_ended_action_ignores_all_requests() -> None:
    running: RunningAction = ENDED
    for step in (running.pause, running.resume, running.cancel):
        step()
