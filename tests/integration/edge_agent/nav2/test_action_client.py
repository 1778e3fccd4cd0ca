"""Driving by Nav2's action: with rclpy's own server, and with the simulator."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator, Iterator
from itertools import count

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriveProgress,
    GoalReport,
    GoalTable,
    Halted,
    NavigationReport,
    Pose,
    PoseReport,
)
from nena_edge_agent.nav2.commands import Server
from nena_edge_agent.nav2.goals import GoalIdPrefix
from nena_edge_agent.nav2.settings import Navigation
from nena_robot_simulator.goals import Action
from support.action_client import Client
from support.action_server import RclpyNav2
from support.action_types import needs_action_types
from support.nav2_driver import MAP, PATIENT, DrivenRobot, goal_at
from support.ros import RosPeer
from support.simulator import simulated_robot
from support.waiting import until

pytestmark = [pytest.mark.ros, needs_action_types]


@pytest.fixture
def nav2(peer: RosPeer) -> Iterator[RclpyNav2]:
    server = RclpyNav2(peer)
    yield server
    server.close()


@pytest.fixture
async def robot(nav2: RclpyNav2, domain_id: int) -> AsyncIterator[DrivenRobot]:  # noqa: ARG001 - is there first
    patient = PATIENT.model_copy(update={"pose_wait": 30.0})
    async with DrivenRobot(domain_id, navigation=Navigation.AUTO, goals=patient) as started:
        yield await started.ready()


async def test_goal_is_sent_by_action_with_our_id(nav2: RclpyNav2, robot: DrivenRobot) -> None:
    report = await robot.driving(goal_at(1, 5.0))
    assert GoalIdPrefix("nena_edge_agent").matches(report.goal_id)
    (goal,) = nav2.goals
    assert (goal.pose.header.frame_id, goal.pose.pose.position.x) == ("map", 5.0)
    assert nav2.by_topic.messages == []
    nav2.end()
    await robot.hears(GoalReport, lambda report: report.status == "SUCCEEDED")

    def arrived() -> list[Arrived]:
        nav2.pose(5.0)  # again and again: until the result has come, feedback takes precedence
        return robot.all(Arrived)

    assert await until(arrived, what="the arrival") == [Arrived(1)]


async def test_feedback_contains_pose_remaining_distance_and_recoveries(
    nav2: RclpyNav2, robot: DrivenRobot
) -> None:
    await robot.driving(goal_at(1, 5.0))
    told = await robot.hears(DriveProgress)
    assert (told.left, told.recoveries) == (3.5, 2)
    await robot.hears(PoseReport, lambda report: report.pose.x == 1.5)
    nav2.end()


async def test_result_contains_nav2s_error_code_and_message(nav2: RclpyNav2, robot: DrivenRobot) -> None:
    await robot.driving(goal_at(1, 5.0))
    nav2.end(106, "Collision ahead")
    failed = await robot.hears(DriveFailed)
    assert failed.failure is DriveFailure.ABORTED
    assert "found no valid command (error code 106: Collision ahead)" in failed.description


async def test_rejected_goal_fails_with_the_reason(nav2: RclpyNav2, robot: DrivenRobot) -> None:
    nav2.accepts = False
    robot.driver.go_to(goal_at(1, 5.0))
    failed = await robot.hears(DriveFailed)
    assert failed.failure is DriveFailure.NOT_TAKEN_UP
    assert "rejected" in failed.description
    assert len(nav2.goals) == 4


async def test_halt_cancels_by_id_and_waits_for_the_end(nav2: RclpyNav2, robot: DrivenRobot) -> None:
    await robot.driving(goal_at(1, 5.0))
    robot.driver.halt()
    await robot.hears(GoalReport, lambda report: report.status == "CANCELING")
    assert robot.ends == []
    nav2.end()
    await robot.hears(Halted)


async def test_external_cancel_is_reported(nav2: RclpyNav2, robot: DrivenRobot) -> None:
    report = await robot.driving(goal_at(1, 5.0))
    assert robot.driver._node is not None
    await robot.driver._node.clients[Server.NAVIGATOR].cancel_goal(report.goal_id)
    nav2.end()
    assert (await robot.hears(DriveFailed)).failure is DriveFailure.CANCELED_FROM_OUTSIDE


@pytest.mark.parametrize("navigation", [Navigation.AUTO, Navigation.TOPICS])
async def test_goals_are_sent_by_topic_without_an_action_server(
    domain_id: int, navigation: Navigation
) -> None:
    with simulated_robot(domain_id, actions=False):
        async with DrivenRobot(domain_id, navigation=navigation) as robot:
            await robot.ready()
            report = await robot.driving(goal_at(1, 3.0))
            assert not GoalIdPrefix("nena_edge_agent").matches(report.goal_id)
            assert await robot.hears(Arrived) == Arrived(1)


async def test_missing_action_server_is_waited_for(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, actions=False):
        async with DrivenRobot(domain_id, navigation=Navigation.ACTION) as robot:
            missing = await robot.hears(NavigationReport, lambda report: "serves" in report.reason)
            assert not missing.available
            server = RclpyNav2(peer)
            await robot.ready()
            server.close()


async def test_action_server_disappears_during_a_drive(domain_id: int) -> None:
    with simulated_robot(domain_id) as node:
        async with DrivenRobot(domain_id, navigation=Navigation.ACTION) as robot:
            await (await robot.ready()).driving(goal_at(1, 30.0))
            node.close()
            assert (await robot.hears(DriveFailed)).failure is DriveFailure.NAVIGATION_GONE
            await until(lambda: robot.all(NavigationReport)[-1].available is False, what="its absence")


async def test_node_skipped_by_nav2_is_driven_to_separately(domain_id: int, peer: RosPeer) -> None:
    server = RclpyNav2(peer, Action.THROUGH_POSES)
    async with DrivenRobot(domain_id, navigation=Navigation.THROUGH_POSES) as robot:
        await robot.ready()
        beside, behind = Pose(5.0, 0.6, 0.0, MAP), Pose(10.0, 0.0, 0.0, MAP)
        await robot.driving(DriveGoal(1, beside, deviation_xy=0.5, ahead=(behind,)))
        await robot.hears(DriveProgress)
        await until(lambda: not robot.driver._feedback.is_fresh(time.monotonic()), what="the end of feedback")
        way = count(40)
        place = 0.0

        def passes_by() -> bool:
            nonlocal place
            if not place or robot.all(PoseReport)[-1].pose.x == place:  # the last step is known
                place = next(way) / 10
                server.pose(place)
            return len(server.goals) > 1

        await until(passes_by, what="the node by a goal of its own")
        places = [[each.pose.position.x for each in goal.poses] for goal in server.goals]
        server.end()
        server.end()
    server.close()
    assert places == [[5.0, 10.0], [5.0]]


async def test_foreign_goal_at_the_action_is_external(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id, navigation=Navigation.ACTION) as robot:
            await robot.ready()
            operator = Client(peer, Action.THROUGH_POSES)
            operator.send((2.0, 0.0), (4.0, 0.0))
            await robot.hears(GoalReport, lambda report: report.external)
            await until(lambda: robot.all(GoalTable)[-1].external == (), what="its end")
