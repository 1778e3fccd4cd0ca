"""Each conversation that Nav2's action server can have, between the driver and a simulator process, over DDS.

A third node receives the arrays. The status topic keeps only its newest array, so an intermediate one may be
missing; the final array, and the driver's conclusions, must not differ.
"""

from __future__ import annotations

import json
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import String
from std_srvs.srv import Trigger

from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure, Halted, NavigationReport
from support.nav2_driver import PATIENT, QUICK, DrivenRobot, goal_at
from support.ros import LATCHED, Inbox, RosPeer
from support.simulator import SimulatorProcess, goal, publisher_to, trace
from support.waiting import until

pytestmark = pytest.mark.ros

STATUS = "navigate_to_pose/_action/status"


@pytest.fixture
def simulator(tmp_path: Path, domain_id: int) -> Callable[..., Any]:
    """Return a function that runs the simulator in a separate process, with more settings."""

    @contextmanager
    def running(*options: str, **fields: Any) -> Iterator[SimulatorProcess]:
        robot = json.dumps([{"domain_id": domain_id, **fields}])
        with SimulatorProcess(
            "--time_factor", "5", "--robots", robot, *options, directory=tmp_path
        ) as process:
            process.wait_for_line("robot ready")
            yield process

    return running


class Arrays:
    """The status arrays that a third node hears."""

    def __init__(self, peer: RosPeer) -> None:
        self._peer = peer
        self._inbox: Inbox[Any] = peer.subscribe(GoalStatusArray, STATUS, LATCHED)

    def known(self) -> None:
        """Wait until the simulator has discovered this node: it answers a client that was made later."""
        active = self._peer.client(Trigger, "lifecycle_manager_navigation/is_active")
        self._peer.call(active, Trigger.Request())

    @property
    def lines(self) -> list[str]:
        return trace(self._inbox.messages)

    async def end_with(self, line: str) -> None:
        await until(lambda: self.lines[-1:] == [line], what=f"'{line}' in the end ({self.lines})")


@pytest.fixture
def arrays(peer: RosPeer) -> Arrays:
    return Arrays(peer)


@pytest.fixture
async def robot(simulator: Callable[..., Any], domain_id: int, arrays: Arrays) -> AsyncIterator[DrivenRobot]:
    with simulator():
        arrays.known()
        async with DrivenRobot(domain_id) as started:
            yield await started.ready()


async def test_plain_drive(robot: DrivenRobot, arrays: Arrays) -> None:
    robot.driver.go_to(goal_at(1, 2.0))
    assert await robot.hears(Arrived) == Arrived(1)
    await arrays.end_with("A:4")
    assert set(arrays.lines) <= {"A:2", "A:4"}
    assert robot.ends == [Arrived(1)]


async def test_second_goal_while_driving(robot: DrivenRobot, arrays: Arrays) -> None:
    await robot.driving(goal_at(1, 35.0))
    robot.driver.go_to(goal_at(2, 6.0))
    assert await robot.hears(Arrived) == Arrived(2)
    await arrays.end_with("A:6 B:4")
    assert set(arrays.lines) <= {"A:2", "A:2 B:2", "A:6 B:2", "A:6 B:4"}
    assert robot.ends == [Arrived(2)]


async def test_three_goals_at_once(robot: DrivenRobot, arrays: Arrays) -> None:
    for generation, x in ((1, 30.0), (2, 20.0), (3, 4.0)):
        robot.driver.go_to(goal_at(generation, x))
    assert await robot.hears(Arrived) == Arrived(3)
    await until(lambda: arrays.lines and arrays.lines[-1].endswith(":4"), what="the end of the last")
    assert "2" not in {part[-1] for part in arrays.lines[-1].split()}
    assert robot.ends == [Arrived(3)]


async def test_cancel_of_all_goals_by_someone_else(robot: DrivenRobot, arrays: Arrays, peer: RosPeer) -> None:
    await robot.driving(goal_at(1, 30.0))
    answer = peer.call(peer.client(CancelGoal, "navigate_to_pose/_action/cancel_goal"), CancelGoal.Request())
    assert (answer.return_code, len(answer.goals_canceling)) == (0, 1)
    failed = await robot.hears(DriveFailed)
    assert failed.failure is DriveFailure.CANCELED_FROM_OUTSIDE
    await arrays.end_with("A:5")
    assert set(arrays.lines) <= {"A:2", "A:3", "A:5"}
    assert robot.ends == [failed]


async def test_goal_outside_the_map(robot: DrivenRobot, arrays: Arrays) -> None:
    robot.driver.go_to(goal_at(1, 500.0))
    assert (await robot.hears(DriveFailed)).failure is DriveFailure.ABORTED
    await arrays.end_with("A:6")


async def test_robot_that_is_not_localised_receives_no_goal_and_aborts_foreign_ones(
    simulator: Callable[..., Any], domain_id: int, arrays: Arrays, peer: RosPeer
) -> None:
    with simulator(localisation={"known_at_start": False}):
        arrays.known()
        async with DrivenRobot(domain_id, goals=QUICK) as robot:
            await robot.hears(NavigationReport, lambda report: "no pose received" in report.reason)
            robot.driver.go_to(goal_at(1, 2.0))
            assert arrays.lines == []
            publisher_to(peer, PoseStamped, "goal_pose").publish(goal(1.0, 0.0))
            await arrays.end_with("A:6")
            assert robot.ends == []


async def test_cancel_and_a_new_goal_directly_after(robot: DrivenRobot, arrays: Arrays) -> None:
    await robot.driving(goal_at(1, 30.0))
    robot.driver.halt()
    robot.driver.go_to(goal_at(2, 6.0))
    assert await robot.hears(Arrived) == Arrived(2)
    await arrays.end_with("A:5 B:4")
    assert all(line.startswith("A:5") for line in arrays.lines if "B" in line)
    assert robot.ends == [Halted(), Arrived(2)]


async def test_deactivated_while_driving(robot: DrivenRobot, arrays: Arrays, peer: RosPeer) -> None:
    await robot.driving(goal_at(1, 30.0))
    publisher_to(peer, String, "simulator/fault").publish(String(data='{"kind": "inactive"}'))
    assert (await robot.hears(DriveFailed)).failure is DriveFailure.ABORTED
    await robot.hears(NavigationReport, lambda report: "not active" in report.reason)
    await arrays.end_with("A:6")


async def test_retention_passed(simulator: Callable[..., Any], domain_id: int, arrays: Arrays) -> None:
    with simulator("--result_timeout", "0.1"):
        arrays.known()
        async with DrivenRobot(domain_id) as robot:
            await robot.ready()
            robot.driver.go_to(goal_at(1, 2.0))
            await robot.hears(Arrived)
            await arrays.end_with("A:4")
            robot.driver.go_to(goal_at(2, 4.0))
            await robot.hears(Arrived, lambda event: event.generation == 2)
            await arrays.end_with("B:4")
            assert robot.ends == [Arrived(1), Arrived(2)]


async def test_server_restarted(simulator: Callable[..., Any], domain_id: int, arrays: Arrays) -> None:
    async with DrivenRobot(domain_id) as robot:
        with simulator() as nav2:
            arrays.known()
            await (await robot.ready()).driving(goal_at(1, 30.0))
            nav2.stop(signal.SIGTERM)
            assert (await robot.hears(DriveFailed)).failure is DriveFailure.NAVIGATION_GONE
            nav2.ended()
        before = len(arrays.lines)
        with simulator():
            await until(lambda: robot.all(NavigationReport)[-1].available, what="Nav2 again")
            assert len(arrays.lines) == before
            arrays.known()
            robot.driver.go_to(goal_at(2, 2.0))
            assert await robot.hears(Arrived) == Arrived(2)
            await arrays.end_with("B:4")


async def test_latched_result_of_a_foreign_drive_is_not_taken_for_ours(
    simulator: Callable[..., Any], domain_id: int, arrays: Arrays, peer: RosPeer
) -> None:
    with simulator():
        arrays.known()
        publisher_to(peer, PoseStamped, "goal_pose").publish(goal(3.0, 0.0))
        await arrays.end_with("A:4")
        goals = PATIENT.model_copy(update={"settle_time": 2.0})
        async with DrivenRobot(domain_id, goals=goals) as robot:
            await robot.ready()
            robot.driver.go_to(goal_at(1, 6.0))
            assert await robot.hears(Arrived) == Arrived(1)
            await arrays.end_with("A:4 B:4")
