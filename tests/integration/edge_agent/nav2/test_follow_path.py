"""Edges with a trajectory or a corridor, driven by the controller's action over DDS."""

from __future__ import annotations

from collections.abc import AsyncIterator
from math import dist
from typing import Any

import pytest
from std_srvs.srv import Empty

from nena_shared.vda5050.order import ControlPoint, Corridor, Order, Trajectory
from support.action_types import needs_action_types
from support.edge_agent import FleetControl, ended, error_types, status_of
from support.nav2_agent import Bench, failure_of, ready
from support.robot_core import action, order, position
from support.simulator import goal, publisher_to
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker, needs_action_types]

FOLLOWING: dict[str, Any] = {"nav2": {"follow_path": True}, "call_timeout": 1.0}
CORNER = (8.0, 0.0)
BEND = Trajectory(
    degree=2,
    knot_vector=(0, 0, 0, 1, 1, 1),
    control_points=tuple(ControlPoint(x=x, y=y) for x, y in ((0.0, 0.0), CORNER, (8.0, 8.0))),
)
PLACES = {"n1": position(8.0, 8.0), "n2": position(8.0, 12.0), "n3": position(0.0, 12.0)}


def edges(*fields: dict[str, Any]) -> Order:
    """Make an order over n0, n1... whose edges have these fields."""
    names = [f"n{index}" for index in range(len(fields) + 1)]
    made = order(*names, positions={name: PLACES[name] for name in names[1:]})
    changed = tuple(edge.model_copy(update=each) for edge, each in zip(made.edges, fields, strict=True))
    return made.model_copy(update={"edges": changed})


ALONG = {"trajectory": BEND, "corridor": Corridor(left_width=0.6, right_width=0.6)}


@pytest.fixture
async def fleet(bench: Bench) -> AsyncIterator[FleetControl]:
    async with bench.robot(time_factor=2.0, ros=FOLLOWING) as control:
        yield control


def off_the_bend(bench: Bench) -> float:
    """Return how far the robot has been off its trajectory at most, m."""
    curve = [(16.0 * t - 8.0 * t * t, 8.0 * t * t) for t in (i / 400 for i in range(401))]
    driven = [(each.pose.pose.position.x, each.pose.pose.position.y) for each in bench.odometry]
    return max(min(dist(place, each) for each in curve) for place in driven)


async def test_trajectory_is_followed_within_its_corridor(bench: Bench, fleet: FleetControl) -> None:
    fleet.send(edges(ALONG))
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])
    assert off_the_bend(bench) < 0.3
    shown = next(each for each in fleet.states if each["edgeStates"])
    assert shown["edgeStates"][0]["trajectory"]["degree"] == 2


async def test_goals_and_paths_alternate(fleet: FleetControl) -> None:
    last = {"corridor": Corridor(left_width=0.5, right_width=0.5)}
    fleet.send(edges(ALONG, {}, last))
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n3", [])


async def test_cancel_stops_the_robot_on_its_path(bench: Bench, fleet: FleetControl) -> None:
    fleet.send(edges(ALONG))
    await bench.moves()
    fleet.instant(action("c", "NONE", "cancelOrder"))
    state = await fleet.state(lambda state: status_of(state, "c") in ("FINISHED", "FAILED"))
    assert (status_of(state, "c"), state["driving"]) == ("FINISHED", False)
    assert await bench.speed_at(state) < 0.05
    assert state["lastNodeId"] == "n0"


async def test_path_is_paused_and_resumed(bench: Bench, fleet: FleetControl) -> None:
    fleet.send(edges(ALONG))
    await bench.moves()
    fleet.instant(action("p", "NONE", "startPause"))
    await fleet.state(lambda state: status_of(state, "p") == "FINISHED")
    assert bench.speed < 0.05
    fleet.instant(action("r", "NONE", "stopPause"))
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])
    assert off_the_bend(bench) < 0.3


@pytest.mark.parametrize("fault", ["server_died", "server_hung"])
async def test_missing_controller_is_reported_and_the_robot_stands(
    bench: Bench, fleet: FleetControl, fault: str
) -> None:
    fleet.send(edges(ALONG))
    await bench.moves()
    bench.fault(fault, server="controller_server")
    await fleet.state(lambda state: "(NAVIGATION_GONE)" in str(state["errors"]))
    await until(lambda: bench.speed < 0.01, what="the robot at rest")
    bench.fault(fault, server="controller_server", active=False)
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])


async def test_reason_of_an_abort_is_reported(bench: Bench, fleet: FleetControl) -> None:
    bench.fault("abort_halfway", fraction=0.5, error_code=105)
    fleet.send(edges(ALONG))
    state = await fleet.state(lambda state: failure_of(state) is not None)
    assert failure_of(state) == "ABORTED"
    assert "makes no progress" in str(state["errors"])


async def test_controllers_abort_without_a_code_does_not_end_the_order(
    bench: Bench, fleet: FleetControl
) -> None:
    bench.fault("abort_halfway", goals=1, fraction=0.5, error_code=0)
    fleet.send(edges(ALONG))
    await fleet.state(lambda state: "DRIVE_RETRIED" in error_types(state))
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])
    assert all(failure_of(each) is None for each in fleet.states)


async def test_path_is_resumed_after_an_operator_took_over(bench: Bench, fleet: FleetControl) -> None:
    rviz = publisher_to(bench.ros, type(goal(0.0, 0.0)), "goal_pose")
    fleet.send(edges(ALONG))
    await bench.moves()
    rviz.publish(goal(6.45, 2.5))
    await fleet.state(lambda state: "EXTERNAL_GOAL" in error_types(state))
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])


async def test_trajectory_is_rejected_without_the_setting(bench: Bench) -> None:
    async with bench.robot() as control:
        control.send(edges({"trajectory": BEND}))
        state = await control.state(lambda state: "orderError" in error_types(state))
        assert state["orderId"] == ""


OPTIONS = ("--ros.nav2.follow_path",)


@pytest.mark.parametrize("arrives_meanwhile", [pytest.param(False, marks=pytest.mark.long), True])
async def test_restarted_agent_drives_the_rest_of_the_path(bench: Bench, *, arrives_meanwhile: bool) -> None:
    with bench.simulator(time_factor=2.0), bench.agent_process(*OPTIONS) as agent:
        await bench.fleet.state(ready)
        bench.fleet.send(edges(ALONG))
        await bench.moves()
        agent.kill()
        if arrives_meanwhile:
            await until(lambda: bench.speed < 0.01, what="the robot at the end of the path")
        agent.restart()
        done = await bench.fleet.state(ended("o1"))
    assert (done["lastNodeId"], error_types(done)) == ("n1", [])
    assert off_the_bend(bench) < 0.6, "it has left its corridor"


@pytest.mark.long
async def test_pause_survives_a_kill_of_the_agent(bench: Bench) -> None:
    with bench.simulator(time_factor=1.0), bench.agent_process(*OPTIONS) as agent:
        await bench.fleet.state(ready)
        bench.fleet.send(edges(ALONG))
        await bench.moves()
        await bench.killed_while_pausing(agent)


async def test_robot_outside_its_corridor_stops_until_it_is_back(bench: Bench, fleet: FleetControl) -> None:
    fleet.send(edges(ALONG))
    await bench.moves()
    bench.fault("pose_jump", x=-2.0, y=2.0)
    await fleet.state(lambda state: "outsideOfCorridor" in error_types(state) and not state["driving"])
    assert bench.speed < 0.05
    bench.fault("pose_jump", active=False)
    fresh = bench.ros.client(Empty, "request_nomotion_update")  # at rest AMCL sends no pose unasked
    bench.ros.call(fresh, Empty.Request())
    state = await fleet.state(ended("o1"))
    assert (state["lastNodeId"], error_types(state)) == ("n1", [])
