"""Nav2 ends a drive for a reason that passes: the order continues, and the state says why it stopped."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped

from nena_edge_agent.nav2.settings import GoalSettings
from support.action_types import needs_action_types, needs_nav2_types
from support.edge_agent import FleetControl, ended, error_types, status_of
from support.nav2_agent import ROS, Bench, failure_of, ready
from support.robot_core import action, order, position
from support.ros import LATCHED
from support.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.broker]

IN_EACH_MODE = pytest.mark.parametrize(
    "navigation",
    [
        "topics",
        pytest.param("action", marks=needs_action_types),
        pytest.param("through_poses", marks=needs_action_types),
    ],
)
SOON: dict[str, Any] = {"retry_wait": 0.2}
WAY = {f"n{number}": position(5.0 * number, radius=0.5) for number in range(3)}
NAVIGATION = "lifecycle_manager_navigation"


async def retried(fleet: FleetControl) -> dict[str, Any]:
    return await fleet.state(lambda state: "DRIVE_RETRIED" in error_types(state))


async def ends_well(fleet: FleetControl) -> None:
    done = await fleet.state(ended("o1"))
    assert error_types(done) == []
    assert all(failure_of(state) is None for state in fleet.states)


@IN_EACH_MODE
@needs_action_types
async def test_time_out_of_a_server_does_not_end_the_order(bench: Bench, navigation: str) -> None:
    drive = {**SOON, "strategy": "pass_through"}
    async with bench.robot(ros={"navigation": navigation}, drive=drive) as fleet:
        bench.fault("abort_halfway", goals=1, error_code=0)
        fleet.send(order(*WAY, positions=WAY))
        state = await retried(fleet)
        assert "retry 1 of 3" in str(state["errors"])
        assert "default_server_timeout" in str(state["errors"])
        await ends_well(fleet)


@needs_action_types
@pytest.mark.parametrize("code", [0, 102])
async def test_cause_that_does_not_pass_fails_after_three_retries(bench: Bench, code: int) -> None:
    async with bench.robot(ros={"navigation": "action"}, drive=SOON) as fleet:
        bench.fault("abort_halfway", fraction=0.0, error_code=code)
        fleet.send(order("n0", "n1"))
        await fleet.state(lambda state: failure_of(state) == "ABORTED")
    told = [each["errorDescription"] for state in fleet.states for each in state["errors"]]
    assert [number for number in range(1, 5) if any(f"retry {number} of 3" in text for text in told)] == [
        1,
        2,
        3,
    ]


@IN_EACH_MODE
@needs_nav2_types
async def test_order_continues_after_a_pause_of_nav2s_lifecycle(bench: Bench, navigation: str) -> None:
    async with bench.robot(time_factor=2.0, ros={"navigation": navigation}, drive=SOON) as fleet:
        manage = manager(bench)
        fleet.send(order("n0", "n1"))
        await bench.moves()
        manage("PAUSE")
        await retried(fleet)
        await fleet.state(lambda state: "navigationNotAvailable" in error_types(state))
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        manage("RESUME")
        await ends_well(fleet)


@pytest.mark.usefixtures("no_nav2_types")
async def test_order_continues_after_nav2_was_inactive_without_nav2_msgs(bench: Bench) -> None:
    async with bench.robot(time_factor=2.0, ros={"navigation": "topics"}, drive=SOON) as fleet:
        fleet.send(order("n0", "n1"))
        await bench.moves()
        bench.fault("inactive")
        await retried(fleet)
        bench.fault("inactive", active=False)
        await ends_well(fleet)


@pytest.mark.usefixtures("no_nav2_types")
async def test_abort_of_a_running_nav2_without_nav2_msgs_fails_the_drive(bench: Bench) -> None:
    async with bench.robot(drive=SOON) as fleet:
        bench.fault("abort_halfway", goals=1, error_code=0)
        fleet.send(order("n0", "n1"))
        assert "Nav2's log" in str(
            (await fleet.state(lambda state: failure_of(state) == "ABORTED"))["errors"]
        )


@IN_EACH_MODE
async def test_order_continues_after_an_ordinary_restart_of_nav2(bench: Bench, navigation: str) -> None:
    async with bench.agent(ros={"navigation": navigation}, drive=SOON) as fleet:
        with bench.simulator() as nav2:
            await fleet.state(ready)
            fleet.send(order("n0", "n3"))
            await bench.moves()
            nav2.stop(signal.SIGTERM)
            await retried(fleet)
            nav2.ended()
            await fleet.state(lambda state: "navigationNotAvailable" in error_types(state))
        with bench.simulator():
            await ends_well(fleet)


@pytest.mark.parametrize("server", ["bt_navigator", "controller_server", "planner_server"])
async def test_order_continues_after_a_server_was_started_again(bench: Bench, server: str) -> None:
    async with bench.robot(time_factor=1.0, drive=SOON) as fleet:
        fleet.send(order("n0", "n1"))
        await bench.moves()
        bench.fault("server_died", server=server)
        await retried(fleet)
        await until(lambda: bench.speed == 0.0, what="the robot at rest")
        bench.fault("server_died", server=server, active=False)
        await ends_well(fleet)


@needs_nav2_types
async def test_restarted_agent_continues_the_order_that_nav2_has_aborted(bench: Bench) -> None:
    with bench.simulator(time_factor=2.0):
        manage = manager(bench)
        async with bench.agent(drive=SOON) as fleet:
            await fleet.state(ready)
            fleet.send(order("n0", "n1"))
            await bench.moves()
            manage("PAUSE")
            await retried(fleet)
        async with bench.agent(drive=SOON) as fleet:
            await fleet.state(lambda state: "not active" in str(state["errors"]))
            manage("RESUME")
            await ends_well(fleet)


@IN_EACH_MODE
async def test_no_goal_is_sent_before_a_new_localisation_has_transforms(
    bench: Bench, navigation: str
) -> None:
    poses = arrivals(bench, PoseWithCovarianceStamped, "amcl_pose")
    goals = [
        arrivals(bench, GoalStatusArray, f"{each}/_action/status", lambda array: array.status_list)
        for each in ("navigate_to_pose", "navigate_through_poses")
    ]
    wait = GoalSettings().localisation_wait
    goal_settings = {**ROS["goals"], "localisation_wait": wait}
    ros = {"navigation": navigation, "goals": goal_settings, "pose_source": "topic"}
    async with bench.robot(ros=ros) as fleet:
        bench.fault("server_died", server="amcl")
        await fleet.state(lambda state: "is not running" in str(state["errors"]))
        bench.fault("server_died", server="amcl", active=False)
        poses.clear()
        fleet.instant(
            action("p", "NONE", "initPosition", x=0.0, y=0.0, theta=0.0, mapId="hall", lastNodeId="n0")
        )
        await fleet.state(lambda state: status_of(state, "p") == "FINISHED")
        fleet.send(order("n0", "n1"))
        await ends_well(fleet)
    first_goal = min(times[0] for times in goals if times)
    assert first_goal - poses[0] >= wait - 0.1


def arrivals(
    bench: Bench, kind: Any, topic: str, counts: Callable[[Any], Any] = lambda _: True
) -> list[float]:
    """Return a list that grows by the time of each message of a topic, monotonic seconds."""
    found: list[float] = []

    def on_message(message: Any) -> None:
        if counts(message):
            found.append(time.monotonic())

    bench.ros.node.create_subscription(kind, topic, on_message, LATCHED)
    return found


def manager(bench: Bench) -> Callable[[str], None]:
    """Return a function that sends a command to Nav2's lifecycle manager."""
    from nav2_msgs.srv import ManageLifecycleNodes  # noqa: PLC0415 - not everywhere

    client = bench.ros.client(ManageLifecycleNodes, f"{NAVIGATION}/manage_nodes")

    def manage(command: str) -> None:
        request = ManageLifecycleNodes.Request(command=getattr(ManageLifecycleNodes.Request, command))
        assert bench.ros.call(client, request).success

    return manage
