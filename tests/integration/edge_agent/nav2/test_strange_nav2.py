"""The driver with a simulated robot that is out of order in a strange way."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager

import pytest
from std_msgs.msg import String

from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure, NavigationReport, PoseReport
from support.nav2_driver import DrivenRobot, goal_at
from support.ros import RosPeer
from support.simulator import heard, publisher_to, simulated_robot
from support.waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture
async def robot(domain_id: int) -> AsyncIterator[DrivenRobot]:
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id) as started:
            yield await started.ready()


class Faults:
    """Starts and ends faults of the robot."""

    def __init__(self, peer: RosPeer) -> None:
        self._peer = peer
        self._publisher = publisher_to(peer, String, "simulator/fault")

    @contextmanager
    def on(self, kind: str) -> Iterator[None]:
        self._publisher.publish(String(data=f'{{"kind": "{kind}"}}'))
        heard(self._peer)
        yield
        self._publisher.publish(String(data=f'{{"kind": "{kind}", "active": false}}'))


@pytest.fixture
def faults(robot: DrivenRobot, peer: RosPeer) -> Faults:
    del robot
    return Faults(peer)


@pytest.mark.parametrize("kind", ["duplicate_status", "reordered_status", "terminal_first"])
async def test_lost_or_repeated_status_arrays_do_no_harm(
    robot: DrivenRobot, faults: Faults, kind: str
) -> None:
    with faults.on(kind):
        for generation in (1, 2):
            robot.driver.go_to(goal_at(generation, 1.0 * generation))
            await until(lambda: len(robot.ends) == generation, what="an end")  # noqa: B023 - at once
    assert robot.ends == [Arrived(1), Arrived(2)]


async def test_nav2_restart_during_a_drive_loses_the_goal(robot: DrivenRobot, faults: Faults) -> None:
    await robot.driving(goal_at(1, 30.0))
    with faults.on("unconfigured"):
        assert (await robot.hears(DriveFailed)).failure is DriveFailure.NAVIGATION_GONE
        await until(lambda: not robot.all(NavigationReport)[-1].available, what="word that it is gone")
    await until(lambda: robot.all(NavigationReport)[-1].available, what="Nav2 again")
    robot.driver.go_to(goal_at(2, robot.all(PoseReport)[-1].pose.x + 2.0))
    assert await robot.hears(Arrived) == Arrived(2)


async def test_success_far_from_the_goal_is_not_an_arrival(robot: DrivenRobot, faults: Faults) -> None:
    with faults.on("pose_jump"):
        robot.driver.go_to(goal_at(1, 6.0))
        assert (await robot.hears(DriveFailed)).failure is DriveFailure.OUTSIDE_TOLERANCE


@pytest.mark.usefixtures("no_nav2_types")
async def test_non_finite_pose_is_ignored(robot: DrivenRobot, faults: Faults) -> None:
    with faults.on("nan_pose"):
        robot.driver.go_to(goal_at(1, 6.0))
        assert (await robot.hears(DriveFailed)).failure is DriveFailure.OUTSIDE_TOLERANCE
    assert all(abs(report.pose.x) < 30.0 for report in robot.all(PoseReport))
