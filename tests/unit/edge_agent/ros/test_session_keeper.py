"""The session's states, with a graph that does what a test says."""

from __future__ import annotations

import asyncio

import pytest

from nena_edge_agent.driver.port import SessionReport
from nena_edge_agent.ros.address import RosAddress
from nena_edge_agent.ros.session_keeper import LONGEST_RETRY, SessionKeeper
from nena_edge_agent.ros.session_state import SessionError
from nena_shared.clock import ManualClock
from support.waiting import until

HERE, THERE = RosAddress("/r1", 7), RosAddress("/r2", 9)


class Graph:
    """Takes nodes in, unless it has a reason not to."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.told: list[SessionReport] = []
        self.problem: Exception | None = None
        self.begun: list[RosAddress] = []
        self.nodes = 0
        self.door = asyncio.Event()
        self.door.set()
        self.keeper = SessionKeeper(
            HERE, begin=self._begin, end=self._end, tell=self.told.append, clock=self.clock, retry=2.0
        )

    async def _begin(self, address: RosAddress) -> None:
        self.begun.append(address)
        await self.door.wait()
        if self.problem:
            raise self.problem
        self.nodes += 1

    async def _end(self) -> None:
        self.nodes -= 1

    @property
    def states(self) -> list[str]:
        return [report.state.value for report in self.told]


async def test_started_and_stopped_with_each_state_told() -> None:
    graph = Graph()
    await graph.keeper.start()
    await graph.keeper.stop()
    assert graph.states == ["INITIATING", "ACTIVE", "TERMINATING", "NOT_ACTIVE"]
    assert {(report.namespace, report.domain_id) for report in graph.told} == {("/r1", 7)}
    assert graph.nodes == 0


async def test_an_impatient_person_starts_it_once() -> None:
    graph = Graph()
    graph.door.clear()
    starts = [asyncio.create_task(graph.keeper.start()) for _ in range(5)]
    await until(lambda: graph.begun, what="the first start")
    graph.door.set()
    await asyncio.gather(*starts)
    assert (graph.begun, graph.nodes) == ([HERE], 1)
    assert graph.states == ["INITIATING", "ACTIVE"]


async def test_what_is_not_there_is_not_stopped() -> None:
    graph = Graph()
    await graph.keeper.stop()
    assert graph.states == []
    graph.keeper.tell_off()
    assert graph.states == ["NOT_ACTIVE"]


async def test_start_and_stop_at_the_same_time_come_one_after_the_other() -> None:
    graph = Graph()
    await asyncio.gather(graph.keeper.start(), graph.keeper.stop(), graph.keeper.start())
    assert graph.states == ["INITIATING", "ACTIVE", "TERMINATING", "NOT_ACTIVE", "INITIATING", "ACTIVE"]
    assert graph.nodes == 1


async def test_a_session_that_cannot_begin_says_why_and_is_tried_again_ever_more_seldom() -> None:
    graph = Graph()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError, match="no network"):
        await graph.keeper.start()
    assert graph.told[-1] == SessionReport(graph.keeper.state, "/r1", 7, "no network")
    assert graph.states == ["INITIATING", "FAILED"]

    pauses = []
    for _ in range(7):
        begun, waited = len(graph.begun), 0.0
        while len(graph.begun) == begun:
            graph.clock.advance(1.0)
            waited += 1.0
            await graph.keeper.look()
        pauses.append(waited)
    assert pauses == [2.0, 4.0, 8.0, 16.0, 32.0, LONGEST_RETRY, LONGEST_RETRY]

    graph.problem = None
    graph.clock.advance(LONGEST_RETRY)
    await graph.keeper.look()
    assert graph.states[-2:] == ["INITIATING", "ACTIVE"]
    assert graph.told[-1].reason == ""


async def test_a_session_that_is_lost_is_begun_anew_at_the_next_look() -> None:
    graph = Graph()
    await graph.keeper.start()
    graph.nodes = 0
    graph.keeper.failed("its thread has ended")
    assert graph.told[-1].reason == "its thread has ended"
    await graph.keeper.look()
    assert graph.states[2:] == ["FAILED", "INITIATING", "ACTIVE"]
    assert graph.nodes == 1


async def test_a_failure_is_over_when_somebody_stops_the_session() -> None:
    graph = Graph()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError):
        await graph.keeper.start()
    await graph.keeper.stop()
    graph.clock.advance(1000.0)
    await graph.keeper.look()
    assert graph.states == ["INITIATING", "FAILED", "NOT_ACTIVE"]
    graph.keeper.failed("late")
    assert graph.states[-1] == "NOT_ACTIVE"


async def test_an_active_session_moves_by_leaving_and_joining() -> None:
    graph = Graph()
    await graph.keeper.start()
    await graph.keeper.move(THERE)
    assert graph.begun == [HERE, THERE]
    assert graph.states[2:] == ["TERMINATING", "NOT_ACTIVE", "INITIATING", "ACTIVE"]
    assert (graph.told[-1].namespace, graph.told[-1].domain_id) == ("/r2", 9)
    assert graph.nodes == 1


async def test_a_session_that_is_off_moves_without_being_started() -> None:
    graph = Graph()
    await graph.keeper.move(THERE)
    assert graph.begun == []
    assert [(report.state, report.namespace) for report in graph.told] == [("NOT_ACTIVE", "/r2")]
    await graph.keeper.start()
    assert graph.begun == [THERE]


async def test_a_session_that_fails_where_it_moved_to_stays_there() -> None:
    graph = Graph()
    await graph.keeper.start()
    graph.problem = SessionError("no network")
    with pytest.raises(SessionError):
        await graph.keeper.move(THERE)
    assert graph.keeper.address == THERE
    graph.problem = None
    graph.clock.advance(2.0)
    await graph.keeper.look()
    assert graph.states[-1] == "ACTIVE"
    assert graph.begun[-1] == THERE


async def test_a_start_that_is_given_up_leaves_it_off() -> None:
    graph = Graph()
    graph.door.clear()
    start = asyncio.create_task(graph.keeper.start())
    await until(lambda: graph.begun, what="the start")
    start.cancel()
    with pytest.raises(asyncio.CancelledError):
        await start
    assert graph.states == ["INITIATING", "NOT_ACTIVE"]
    graph.door.set()
    await graph.keeper.start()
    assert graph.states[-1] == "ACTIVE"
