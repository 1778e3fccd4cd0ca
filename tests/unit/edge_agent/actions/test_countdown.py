from __future__ import annotations

from nena_edge_agent.actions.countdown import Countdown
from nena_edge_agent.protocol.events import ActionReport
from support.waiting import until


async def test_behind_its_end_nothing_can_be_done_to_it() -> None:
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
