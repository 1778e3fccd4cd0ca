from __future__ import annotations

import asyncio

from nena_edge_agent.actions.background import BackgroundAction, WorkFailedError
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
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
        return await until(lambda: next((each for each in self.reports if each.status.ended), None))


async def test_it_ends_as_its_work_does() -> None:
    trial = Trial()
    trial.free.set()

    assert await trial.end() is FINISHED
    assert (await Trial("fail").end()).result == "no power"
    assert (await Trial("raise").end()).result == "the plug-in failed: raise"


async def test_one_that_is_given_up_puts_things_right_first() -> None:
    trial = Trial()
    await until(trial.begun.is_set)
    trial.action.cancel()
    assert not trial.action.ended

    assert (await trial.end()).result == "cancelled"
    assert trial.reports[-2].result == "puts things right"


async def test_one_that_is_given_up_before_it_began_says_so_too() -> None:
    trial = Trial()
    trial.action.cancel()

    assert (await trial.end()).result == "cancelled"
    assert trial.action.ended
