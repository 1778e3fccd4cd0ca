"""The ROS session of a real agent, over real DDS: started, stopped, moved, and what orders meet meanwhile."""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import pytest
from std_msgs.msg import String

from nena_edge_agent.driver.port import SessionError, SessionState
from nena_edge_agent.nav2.session import RosSession
from nena_shared.vda5050.own_actions import (
    CONFIGURE_ROS_SESSION,
    ROS_SESSION,
    START_ROS_SESSION,
    STOP_ROS_SESSION,
)
from support.broker import Broker
from support.edge_agent import ended, error_types, status_of
from support.nav2_agent import Bench, ready
from support.robot_core import action, order
from support.ros import BEST_EFFORT, RELIABLE, RosPeer
from support.served_aggregator import serving
from support.session_cycles import measured
from support.simulator import simulated_robot
from support.waiting import PATIENCE, until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

CYCLES = int(os.environ.get("NENA_SESSIONS", "20"))
"""Starts and stops in the test for leaks; `make soak` has more."""
GROWTH = 5.0
"""MB of memory that so many may cost."""


def session_in(state: dict[str, Any]) -> dict[str, str]:
    """Return a state's information about the session."""
    for entry in state.get("information") or ():
        if entry["infoType"] == ROS_SESSION:
            return {each["referenceKey"]: each["referenceValue"] for each in entry["infoReferences"]}
    return {}


async def does(bench: Bench, action_id: str, action_type: str, **parameters: Any) -> dict[str, Any]:
    """Execute an instant action; return the first state in which it has ended."""
    bench.fleet.instant(action(action_id, action_type=action_type, **parameters))
    return await bench.fleet.state(lambda state: status_of(state, action_id) in ("FINISHED", "FAILED"))


async def test_agent_rejects_orders_until_its_session_is_started(bench: Bench) -> None:
    with bench.simulator():
        async with bench.agent(ros={"start_session": False}) as fleet:
            off = await fleet.state(lambda state: session_in(state).get("state") == "NOT_ACTIVE")
            assert error_types(off) == ["navigationNotAvailable"]
            fleet.send(order("n0", "n1", order_id="early"))
            refused = await fleet.state(lambda state: "orderError" in error_types(state))
            assert refused["orderId"] == ""

            started = await does(bench, "s1", START_ROS_SESSION)
            assert status_of(started, "s1") == "FINISHED"
            await fleet.state(ready)
            fleet.send(order("n0", "n1"))
            done = await fleet.state(ended("o1"))
            assert error_types(done) == []


async def test_session_stops_after_its_order_and_leaves_the_ros_graph(bench: Bench) -> None:
    def there() -> bool:
        return "nena_edge_agent" in bench.ros.node.get_node_names()

    async with bench.robot() as fleet:
        fleet.send(order("n0", "n3"))
        await bench.moves()
        refused = await does(bench, "s1", STOP_ROS_SESSION)
        assert status_of(refused, "s1") == "FAILED"
        assert session_in(refused)["state"] == "ACTIVE"
        await fleet.state(ended("o1"))

        await until(there, what="the node in the graph")
        stopped = await does(bench, "s2", STOP_ROS_SESSION)
        assert status_of(stopped, "s2") == "FINISHED"
        off = await fleet.state(lambda state: session_in(state).get("state") == "NOT_ACTIVE")
        assert not off["agvPosition"]["positionInitialized"]
        await until(lambda: not there(), what="the node's leave")
        seen = {session_in(state).get("state") for state in fleet.states}
        assert {"ACTIVE", "NOT_ACTIVE"} <= seen


async def test_agent_is_moved_to_another_namespace_permanently(bench: Bench) -> None:
    with bench.simulator(namespace="r1", start={"x": 5.0}), bench.simulator(namespace="r2"):
        async with bench.agent(ros={"namespace": "r1"}) as fleet:
            first = await fleet.state(ready)
            assert first["agvPosition"]["x"] == pytest.approx(5.0, abs=0.2)
            moved = await does(bench, "c1", CONFIGURE_ROS_SESSION, namespace="r2", keep=True)
            assert status_of(moved, "c1") == "FINISHED"
            await fleet.state(lambda state: ready(state) and state["agvPosition"]["x"] < 1.0)
            fleet.send(order("n0", "n1"))
            await fleet.state(ended("o1"))
        count = len(bench.fleet.states)
        async with bench.agent(ros={"namespace": "r1"}):
            await until(
                lambda: any(session_in(state).get("namespace") == "/r2" for state in fleet.states[count:]),
                what="the namespace that was kept",
            )


async def test_the_aggregator_shows_the_session(
    bench: Bench, broker: Broker, interface_name: str, domain_id: int
) -> None:
    async with serving(broker, interface_name) as served, bench.agent(ros={"start_session": False}):
        path = "/api/v1/robots/ACME/0001"

        async def shows(session: str) -> Any:
            return await served.until(path, lambda robot: robot.get("session") == session)

        robot = await shows("NOT_ACTIVE")
        assert robot["rosSession"] == {"state": "NOT_ACTIVE", "namespace": "/", "domainId": str(domain_id)}
        await does(bench, "s1", START_ROS_SESSION)
        await shows("ACTIVE")
        await does(bench, "s2", STOP_ROS_SESSION)
        await shows("NOT_ACTIVE")


@pytest.mark.timeout(900)
def test_starts_and_stops_leak_nothing(domain_id: int) -> None:
    with simulated_robot(domain_id):
        left = measured(domain_id, CYCLES)
    assert left["threads_more"] <= 0
    assert left["descriptors_more"] <= 0
    assert left["memory_more_mb"] <= GROWTH


async def test_node_that_cannot_be_set_up_is_reported_and_its_thread_ends(domain_id: int) -> None:
    def refuse(_: object) -> None:
        message = "no room"
        raise RuntimeError(message)

    session = RosSession(node_name="short_lived", namespace="/", domain_id=domain_id)
    with pytest.raises(SessionError, match="no room"):
        await session.start(refuse)
    assert (session.state, session.reason) == (SessionState.FAILED, "no room")
    await until(lambda: not session._thread.is_alive(), what="the thread's end")


async def test_abandoned_start_leaves_no_thread(domain_id: int) -> None:
    there, go_on = threading.Event(), threading.Event()

    def furnish(_: object) -> None:
        there.set()
        go_on.wait(PATIENCE)

    session = RosSession(node_name="short_lived", namespace="/", domain_id=domain_id)
    start = asyncio.create_task(session.start(furnish))
    await until(there.is_set, what="the node")
    start.cancel()
    with pytest.raises(asyncio.CancelledError):
        await start
    go_on.set()
    await until(lambda: not session._thread.is_alive(), what="the thread's end")


@asynccontextmanager
async def session_with_node(domain_id: int) -> AsyncIterator[tuple[RosSession, Any]]:
    session = RosSession(node_name="agent_under_test", namespace="/", domain_id=domain_id)
    nodes: list[Any] = []
    await session.start(nodes.append)
    yield session, nodes[0]
    await session.stop()


MESSAGES = 20


async def test_tasks_and_changes_of_the_node_are_served_between_messages(domain_id: int) -> None:
    async with session_with_node(domain_id) as (session, node):
        done: list[int] = []
        for number in range(MESSAGES):
            assert session._executor is not None
            session._executor.create_task(done.append, number)
            await until(partial(done.__contains__, number), what="the task")
        timer = node.create_timer(0.001, lambda: done.append(-1))
        await until(lambda: done[-1] == -1, what="the timer")
        node.destroy_timer(timer)
        assert session._executor is not None
        session._executor.create_task(done.append, MESSAGES)
        await until(lambda: done[-1] == MESSAGES, what="the task after the timer's end")


async def test_an_incompatible_publisher_of_a_reliable_topic_is_noticed(domain_id: int) -> None:
    noticed: list[object] = []
    async with session_with_node(domain_id) as (session, node):
        lift = session.subscribe(
            node, String, "lift", RELIABLE, read=lambda each: each.data, handle=print, events=True
        )
        for handler in lift.event_handlers:
            handler.callback = noticed.append
        with RosPeer(domain_id) as peer:
            peer.node.create_publisher(String, "lift", BEST_EFFORT)
            await until(lambda: noticed, what="the event")
