"""The driver with simulated robots, over DDS."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, contextmanager

import pytest
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from std_msgs.msg import String

from nena_edge_agent.driver.port import (
    Arrived,
    BatteryReport,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    GoalReport,
    Halted,
    NavigationReport,
    PlanReport,
    Pose,
    PoseReport,
    PositionInitialized,
)
from nena_edge_agent.nav2.settings import LocalisationSettings, Navigation
from support.action_types import needs_action_types
from support.nav2_driver import MAP, PATIENT, QUICK, DrivenRobot, goal_at
from support.ros import BEST_EFFORT, LATCHED, RosPeer
from support.simulator import goal, heard, publisher_to, simulated_robot
from support.waiting import PATIENCE, until, wait_until

pytestmark = pytest.mark.ros


@contextmanager
def fault(peer: RosPeer, text: str) -> Iterator[None]:
    """Switch a fault of the simulated robot on."""
    publisher = publisher_to(peer, String, "simulator/fault")
    publisher.publish(String(data=text))
    heard(peer)
    yield
    peer.node.destroy_publisher(publisher)


def statuses(peer: RosPeer, namespace: str = "") -> list[int]:
    """Return the statuses of the newest array of a simulated robot."""
    topic = f"/{namespace}/navigate_to_pose/_action/status".replace("//", "/")
    array = peer.subscribe(GoalStatusArray, topic, LATCHED).wait_for()
    return [entry.status for entry in array.status_list]


@pytest.fixture(params=[Navigation.TOPICS, pytest.param(Navigation.ACTION, marks=needs_action_types)])
def navigation(request: pytest.FixtureRequest) -> Navigation:
    """Return each way to drive a robot: by topics, and by the action."""
    found: Navigation = request.param
    return found


@pytest.fixture
async def robot(domain_id: int, navigation: Navigation) -> AsyncIterator[DrivenRobot]:
    """Yield a robot with long timeouts; its standstill is determined by its odometry."""
    goals = PATIENT.model_copy(update={"standstill_timeout": 600.0})
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id, navigation=navigation, goals=goals) as started:
            yield await started.ready()


@pytest.fixture
async def hurried_robot(domain_id: int, navigation: Navigation) -> AsyncIterator[DrivenRobot]:
    """Yield a robot to which goals are resent soon."""
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id, navigation=navigation, goals=QUICK) as started:
            yield await started.ready()


async def test_drives_to_its_goal(robot: DrivenRobot) -> None:
    robot.driver.go_to(goal_at(1, 4.0, 2.0))
    assert await robot.hears(Arrived) == Arrived(1)
    pose = robot.all(PoseReport)[-1].pose
    assert (pose.x, pose.y) == pytest.approx((4.0, 2.0), abs=0.5)
    assert pose.map_id == MAP
    assert robot.ends == [Arrived(1)]


async def test_unreachable_goal(robot: DrivenRobot, peer: RosPeer) -> None:
    with fault(peer, '{"kind": "unreachable"}'):
        robot.driver.go_to(goal_at(1, 4.0))
        assert (await robot.hears(DriveFailed)).failure is DriveFailure.ABORTED


async def test_drive_aborted_halfway(robot: DrivenRobot, peer: RosPeer) -> None:
    with fault(peer, '{"kind": "abort_halfway"}'):
        robot.driver.go_to(goal_at(1, 4.0))
        assert (await robot.hears(DriveFailed)).failure is DriveFailure.ABORTED
    await robot.hears(PoseReport, lambda report: report.pose.x > 1.0)
    assert max(report.pose.x for report in robot.all(PoseReport)) < 3.5


async def test_drive_cancelled_by_someone_else(robot: DrivenRobot, peer: RosPeer) -> None:
    canceller = peer.client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
    await robot.driving(goal_at(1, 30.0))
    peer.call(canceller, CancelGoal.Request())
    assert (await robot.hears(DriveFailed)).failure is DriveFailure.CANCELED_FROM_OUTSIDE


async def test_lost_goal_is_resent(hurried_robot: DrivenRobot, peer: RosPeer) -> None:
    robot = hurried_robot
    with fault(peer, '{"kind": "reject_goals", "goals": 2}'):
        robot.driver.go_to(goal_at(1, 3.0))
        assert await robot.hears(Arrived) == Arrived(1)


async def test_goal_that_is_always_lost(hurried_robot: DrivenRobot, peer: RosPeer) -> None:
    robot = hurried_robot
    with fault(peer, '{"kind": "reject_goals"}'):
        robot.driver.go_to(goal_at(1, 3.0))
        failed = await robot.hears(DriveFailed)
    assert failed.failure is DriveFailure.NOT_TAKEN_UP
    assert robot.ends == [failed]


async def test_external_goal_is_reported_and_left_alone(robot: DrivenRobot, peer: RosPeer) -> None:
    with fault(peer, '{"kind": "foreign_goal", "x": 3.0, "y": 0.0}'):
        ended = await robot.hears(GoalReport, lambda report: report.status == "SUCCEEDED")
    assert ended.external
    assert robot.ends == []


async def test_external_goal_takes_the_robot_over(robot: DrivenRobot, peer: RosPeer) -> None:
    rviz = publisher_to(peer, PoseStamped, "goal_pose")
    ours = await robot.driving(goal_at(1, 30.0))
    rviz.publish(goal(3.0, 3.0))
    failed = await robot.hears(DriveFailed)
    assert failed.failure is DriveFailure.TAKEN_OVER
    theirs = await robot.hears(GoalReport, lambda report: report.external and report.status == "SUCCEEDED")
    assert theirs.goal_id != ours.goal_id
    assert theirs.goal_id in failed.description


async def test_next_goal_replaces_the_active_one_without_a_stop(robot: DrivenRobot, peer: RosPeer) -> None:
    odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
    await robot.driving(goal_at(1, 25.0))
    await robot.hears(PoseReport, lambda report: report.pose.x > 5.0)
    await robot.driving(goal_at(2, 35.0))
    assert await robot.hears(Arrived) == Arrived(2)
    told = [(each.pose.pose.position.x, each.twist.twist.linear.x) for each in odometry.messages]
    speeds = [speed for x, speed in told if 5.0 < x < 30.0]
    assert robot.ends == [Arrived(2)]
    assert min(speeds) > 2.5


async def test_only_the_plan_of_our_own_drive_is_reported(robot: DrivenRobot, peer: RosPeer) -> None:
    with fault(peer, '{"kind": "foreign_goal", "x": 2.0, "y": 2.0}'):
        await robot.hears(GoalReport, lambda report: report.ended)
    assert robot.all(PlanReport) == []
    await robot.driving(goal_at(1, 15.0))
    plan = await robot.hears(PlanReport)
    assert plan.points[-1] == pytest.approx((15.0, 0.0), abs=0.75)


async def test_halt_during_a_drive(robot: DrivenRobot, peer: RosPeer) -> None:
    await robot.driving(goal_at(1, 30.0))
    await robot.hears(PoseReport, lambda report: (report.vx or 0.0) > 3.0)
    robot.driver.halt()
    await robot.hears(Halted)
    assert robot.all(PoseReport)[-1].vx == 0.0
    assert statuses(peer) == [5]
    assert robot.ends == [Halted()]
    robot.driver.go_to(goal_at(2, 8.0))
    assert await robot.hears(Arrived) == Arrived(2)


async def test_halt_of_a_standing_robot(robot: DrivenRobot) -> None:
    robot.driver.halt()
    await robot.hears(Halted)


async def test_stop_during_a_drive_leaves_the_robot_standing(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id, stop_timeout=PATIENCE) as robot:
            await (await robot.ready()).driving(goal_at(1, 30.0))
        assert statuses(peer) == [5]
        assert robot.ends == []


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (Pose(3.0, 0.0, 0.0, "attic"), "map 'attic'"),
        (Pose(math.nan, 0.0, 0.0, MAP), "is not a valid pose"),
    ],
)
async def test_invalid_goal(robot: DrivenRobot, place: Pose, reason: str) -> None:
    await robot.driving(goal_at(1, 30.0))
    robot.driver.go_to(DriveGoal(2, place, deviation_xy=0.5))
    failed = await robot.hears(DriveFailed)
    assert failed.generation == 2
    assert reason in failed.description
    await robot.hears(GoalReport, lambda report: report.status == "CANCELED")
    assert robot.ends == [failed]


async def test_invalid_position_is_not_sent_to_the_localisation(robot: DrivenRobot) -> None:
    robot.driver.initialize_position(Pose(math.inf, 0.0, 0.0, MAP))
    assert not (await robot.hears(PositionInitialized)).succeeded


async def test_lost_localisation_is_reported(domain_id: int) -> None:
    with simulated_robot(domain_id, localisation={"known_at_start": False}):
        async with DrivenRobot(domain_id) as robot:
            missing = await robot.hears(NavigationReport, lambda report: "amcl_pose" in report.reason)
            assert not missing.available
            robot.driver.initialize_position(Pose(2.0, 1.0, -2.5, MAP))
            assert (await robot.hears(PositionInitialized)).succeeded
            await robot.ready()
            report = robot.all(PoseReport)[-1]
    assert (report.pose.x, report.pose.y) == pytest.approx((2.0, 1.0), abs=0.2)
    assert report.pose.theta == pytest.approx(-2.5, abs=0.1)
    assert report.localized


async def test_unconfirmed_initial_position(domain_id: int, peer: RosPeer) -> None:
    patience = LocalisationSettings(initial_wait=0.2, initial_attempts=2)
    with simulated_robot(domain_id):
        async with DrivenRobot(domain_id, localisation=patience) as robot:
            await robot.ready()
            with fault(peer, '{"kind": "amcl_silent"}'):
                robot.driver.initialize_position(Pose(2.0, 1.0, 0.0, MAP))
                answer = await robot.hears(PositionInitialized)
    assert not answer.succeeded
    assert "after 2 initial positions" in answer.description


@pytest.mark.parametrize("scale", ["fraction", "percent"])
async def test_battery(domain_id: int, scale: str) -> None:
    with simulated_robot(domain_id, battery={"charge": 0.42, "scale": scale}):
        async with DrivenRobot(domain_id, battery_scale=scale) as robot:
            report = await robot.hears(BatteryReport)
    assert report.state_of_charge == pytest.approx(42.0, abs=0.1)
    assert not report.charging


async def test_two_namespaces_of_one_domain_do_not_see_each_other(domain_id: int, peer: RosPeer) -> None:
    async with AsyncExitStack() as stack:
        stack.enter_context(simulated_robot(domain_id, "r1", name="one"))
        stack.enter_context(simulated_robot(domain_id, "r2", name="two"))
        one = await stack.enter_async_context(DrivenRobot(domain_id, "r1"))
        two = await stack.enter_async_context(DrivenRobot(domain_id, "r2"))
        await one.ready()
        await two.ready()
        one.driver.go_to(goal_at(1, 3.0))
        assert await one.hears(Arrived) == Arrived(1)
        assert statuses(peer, "r1") == [4]
        assert not two.all(GoalReport)
        two.driver.go_to(goal_at(7, 5.0))
        assert await two.hears(Arrived) == Arrived(7)
        assert len({report.goal_id for report in one.all(GoalReport)}) == 1


async def test_two_domains_do_not_see_each_other(domain_id: int, other_domain_id: int) -> None:
    async with AsyncExitStack() as stack:
        stack.enter_context(simulated_robot(domain_id, name="one"))
        stack.enter_context(simulated_robot(other_domain_id, name="two"))
        one = await stack.enter_async_context(DrivenRobot(domain_id))
        two = await stack.enter_async_context(DrivenRobot(other_domain_id))
        await one.ready()
        await two.ready()
        one.driver.go_to(goal_at(1, 3.0))
        two.driver.go_to(goal_at(7, 5.0))
        assert await one.hears(Arrived) == Arrived(1)
        assert await two.hears(Arrived) == Arrived(7)
        for told in (one, two):
            assert len({report.goal_id for report in told.all(GoalReport)}) == 1


async def test_is_an_ordinary_node_of_the_ros_graph(domain_id: int, peer: RosPeer) -> None:
    async with DrivenRobot(domain_id, "r1"):
        wait_until(
            lambda: ("nena_edge_agent", "/r1") in peer.node.get_node_names_and_namespaces(),
            what="the node in the graph",
        )
    await until(
        lambda: ("nena_edge_agent", "/r1") not in peer.node.get_node_names_and_namespaces(),
        what="the node's leave",
    )
