"""Nav2 that is not there, comes, hangs, goes and comes back; the driver beside it."""

from __future__ import annotations

import asyncio
import signal
from pathlib import Path

import pytest
from std_msgs.msg import String

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    GoalReport,
    Halted,
    NavigationReport,
)
from support.nav2_driver import PATIENT, QUICK, DrivenRobot, goal_at
from support.ros import RosPeer
from support.simulator import SimulatorProcess, publisher_to, simulated_robot
from support.waiting import PATIENCE, until

pytestmark = pytest.mark.ros

LEASE = 20.0
"""Seconds that DDS gives a participant that is silent and has not said goodbye."""


def one_robot(directory: Path, domain_id: int) -> str:
    file = directory / "simulator.toml"
    file.write_text(f"time_factor = 5\n[[robots]]\ndomain_id = {domain_id}\n", encoding="utf-8")
    return str(file)


async def test_nav2_missing_at_startup_then_available(domain_id: int) -> None:
    async with DrivenRobot(domain_id, "r1", goals=PATIENT.model_copy(update={"resends": 20})) as robot:
        missing = await robot.hears(NavigationReport, lambda report: not report.starting)
        assert not missing.available
        assert "no node publishes navigate_to_pose/_action/status in namespace /r1" in missing.reason
        assert f"domain {domain_id}" in missing.reason
        robot.driver.go_to(goal_at(1, 3.0))
        with simulated_robot(domain_id, "r1"):
            assert await robot.hears(Arrived) == Arrived(1)


async def test_goal_waits_for_nav2_until_it_is_withdrawn(domain_id: int) -> None:
    async with DrivenRobot(domain_id, goals=QUICK) as robot:
        robot.driver.go_to(goal_at(1, 3.0))
        await robot.hears(NavigationReport, lambda report: "is Nav2 running there?" in report.reason)
        robot.driver.halt()
        assert await robot.hears(Halted) == Halted()
        assert robot.ends == [Halted()]


async def test_inactive_nav2(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id) as robot:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            faults = publisher_to(peer, String, "simulator/fault")
            faults.publish(String(data='{"kind": "inactive"}'))
            assert (await robot.hears(DriveFailed)).failure is DriveFailure.ABORTED
            await robot.hears(NavigationReport, lambda report: "not active" in report.reason)
            faults.publish(String(data='{"kind": "inactive", "active": false}'))
            await until(lambda: robot.all(NavigationReport)[-1].available, what="Nav2 active again")


async def test_nav2_shuts_down_during_a_drive_and_returns(domain_id: int, tmp_path: Path) -> None:
    file = one_robot(tmp_path, domain_id)
    async with DrivenRobot(domain_id) as robot:
        with SimulatorProcess("--config", file, directory=tmp_path) as nav2:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            nav2.stop(signal.SIGTERM)
            await asyncio.to_thread(nav2.ended)  # however long that takes, it has said goodbye
            failed = await robot.hears(DriveFailed, seconds=0.75 * LEASE)
        assert failed.failure is DriveFailure.NAVIGATION_GONE
        await until(lambda: not robot.all(NavigationReport)[-1].available, what="word that Nav2 is gone")
        with SimulatorProcess("--config", file, directory=tmp_path):
            await until(lambda: robot.all(NavigationReport)[-1].available, what="Nav2 again")
            robot.driver.go_to(goal_at(2, 3.0))
            assert await robot.hears(Arrived) == Arrived(2)


@pytest.mark.long
async def test_nav2_crash_is_reported_in_seconds_and_its_drive_ends_with_the_lease(
    domain_id: int, tmp_path: Path
) -> None:
    file = one_robot(tmp_path, domain_id)
    async with DrivenRobot(domain_id, call_timeout=0.3) as robot:
        with SimulatorProcess("--config", file, directory=tmp_path) as nav2:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            nav2.stop(signal.SIGKILL)
            await robot.hears(
                NavigationReport, lambda report: "not answer" in report.reason, seconds=0.75 * LEASE
            )
            assert robot.ends == []
            assert (await robot.hears(DriveFailed)).failure is DriveFailure.NAVIGATION_GONE


async def test_hanging_nav2_is_reported(domain_id: int, tmp_path: Path) -> None:
    async with DrivenRobot(domain_id, call_timeout=0.3) as robot:
        with SimulatorProcess("--config", one_robot(tmp_path, domain_id), directory=tmp_path) as nav2:
            await robot.ready()
            robot.events.clear()  # at the agent's own start Nav2 may not answer yet
            nav2.stop(signal.SIGSTOP)
            await robot.hears(NavigationReport, lambda report: "does not answer" in report.reason)
        assert not robot.all(NavigationReport)[-1].available


async def test_failed_ros_thread_is_reported_and_restarted(domain_id: int) -> None:
    def fail() -> None:
        message = "out of order"
        raise RuntimeError(message)

    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id) as robot:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            assert robot.driver._node is not None
            assert robot.driver._node._session._executor is not None
            robot.driver._node._session._executor.create_task(fail)
            await robot.hears(NavigationReport, lambda report: "out of order" in report.reason)
            assert (await robot.hears(DriveFailed)).failure is DriveFailure.NAVIGATION_GONE
            await until(lambda: robot.all(NavigationReport)[-1].available, what="the node again")
            robot.driver.go_to(goal_at(2, 3.0))
            assert await robot.hears(Arrived) == Arrived(2)


async def test_stop_is_bounded_where_nav2_does_not_stop_the_robot(domain_id: int, tmp_path: Path) -> None:
    async with DrivenRobot(domain_id, stop_timeout=0.5, call_timeout=0.3) as robot:
        with SimulatorProcess("--config", one_robot(tmp_path, domain_id), directory=tmp_path) as nav2:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            await robot.hears(GoalReport, lambda report: report.status == "EXECUTING")
            nav2.stop(signal.SIGSTOP)
            async with asyncio.timeout(PATIENCE):
                await robot.driver.stop()
