"""Limits of edges and zones, obeyed by Nav2's controller over real DDS."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.nav2.settings import Navigation
from support.action_types import needs_nav2_types
from support.edge_agent import ended, error_types
from support.nav2_agent import Bench, ready
from support.robot_core import order, position
from support.ros import RELIABLE
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_nav2_types]

SLOW = 0.4


def limited(*node_ids: str, slow: int, places: dict[str, Any]) -> Any:
    """Return an order of whose edges one, counted from 0, has a limit."""
    made = order(*node_ids, positions=places)
    edges = [
        each.model_copy(update={"maximum_speed": SLOW}) if number == slow else each
        for number, each in enumerate(made.edges)
    ]
    return made.model_copy(update={"edges": tuple(edges)})


def limits(bench: Bench) -> Any:
    """Record the limits that the controller receives."""
    from nav2_msgs.msg import SpeedLimit  # noqa: PLC0415 - not everywhere

    return bench.ros.subscribe(SpeedLimit, "speed_limit", RELIABLE)


@pytest.mark.clause("7.3/speed")
async def test_an_edge_with_a_limit_is_driven_slowly_and_the_next_one_not(bench: Bench) -> None:
    told = limits(bench)
    places = {f"n{number}": position(3.0 * number, radius=0.5) for number in range(4)}
    with bench.simulator(time_factor=1.0):
        async with bench.agent(drive={"strategy": "pass_through", "pass_radius": 0.5}) as fleet:
            await fleet.state(ready)
            fleet.send(limited("n0", "n1", "n2", "n3", slow=1, places=places))
            done = await fleet.state(ended("o1"))
            await until(lambda: told.messages[-1].speed_limit == 0.0, what="no limit")
    assert error_types(done) == []
    assert max(bench.speeds(3.1, 5.2)) <= SLOW + 0.05
    assert max(bench.speeds(0.0, 1.5)) > 2 * SLOW
    assert max(bench.speeds(7.0, 9.0)) > 2 * SLOW
    assert {each.percentage for each in told.messages} == {False}


@pytest.mark.parametrize("navigation", [*Navigation])
@pytest.mark.parametrize("strategy", ["pass_through", "stop_at_nodes"])
async def test_a_limit_holds_up_to_the_end_of_its_edge(
    bench: Bench, strategy: str, navigation: Navigation
) -> None:
    places = {f"n{number}": position(4.0 * number, radius=1.0) for number in range(3)}
    drive = {"strategy": strategy, "pass_radius": 1.0}
    with bench.simulator(time_factor=1.0):
        async with bench.agent(drive=drive, ros={"navigation": navigation}) as fleet:
            await fleet.state(ready)
            fleet.send(limited("n0", "n1", "n2", slow=0, places=places))
            done = await fleet.state(ended("o1"))
    assert error_types(done) == []
    assert max(bench.speeds(1.0, 3.95)) <= SLOW + 0.05
    assert max(bench.speeds(4.5, 7.0)) > 2 * SLOW


async def test_speed_limit_survives_a_restart_and_is_lifted_after_its_edge(
    bench: Bench,
) -> None:
    places = {"n0": position(0.0), "n1": position(3.0), "n2": position(6.0)}
    with bench.simulator(time_factor=1.0):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            fleet.send(limited("n0", "n1", "n2", slow=0, places=places))
            await until(lambda: bench.speed > SLOW - 0.05, what="the robot at its limit")
        told = limits(bench)
        before = len(bench.fleet.states)
        async with bench.agent() as fleet:
            await until(lambda: any(ended("o1")(each) for each in fleet.states[before:]), what="the end")
            await until(lambda: told.messages[-1].speed_limit == 0.0, what="no limit")
    assert max(bench.speeds(0.0, 2.5)) <= SLOW + 0.05
    assert max(bench.speeds(3.5, 5.5)) > 2 * SLOW


async def test_goal_with_a_speed_limit_waits_for_the_controller(bench: Bench) -> None:
    places = {"n0": position(0.0), "n1": position(2.0)}
    with bench.simulator("--no-actions"):
        async with bench.agent() as fleet:
            await fleet.state(ready)
            fleet.send(limited("n0", "n1", slow=0, places=places))
            await fleet.state(
                lambda state: any(
                    "no node subscribes to speed_limit" in each["errorDescription"]
                    for each in state["errors"]
                )
            )
            assert bench.speed == 0.0
