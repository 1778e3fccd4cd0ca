"""The recorded conversations of Nav2's action server, replayed to the driver over DDS."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriverEvent,
    GoalReport,
    Halted,
    PoseReport,
)
from support.nav2_driver import PATIENT, QUICK, DrivenRobot, ScriptedNav2, goal_at, uuid_of
from support.ros import RosPeer
from support.waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture
def nav2(peer: RosPeer) -> ScriptedNav2:
    return ScriptedNav2(peer)


@pytest.fixture
async def robot(nav2: ScriptedNav2, domain_id: int) -> AsyncIterator[DrivenRobot]:
    del nav2
    goals = PATIENT.model_copy(update={"pose_wait": QUICK.pose_wait})  # poses are there before they count
    async with DrivenRobot(domain_id, goals=goals) as started:
        yield await started.ready()


async def play(script: str, nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    """Run a script; return an unknown direction.

    ``goal 2`` sends a goal at x = 20 m, ``at 2`` puts the robot there, ``ended`` waits for a drive's end.
    """
    for line in (part.strip() for part in script.split("|")):
        match line.split():
            case ["goal", number]:
                await give(int(number), nav2, robot)
            case ["at", number]:
                await be_at(int(number), nav2, robot)
            case ["ended"]:
                await until(lambda: robot.ends, what="the end of a drive")
            case _:
                nav2.array(line)


async def give(number: int, nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    before = len(nav2.goals.messages)
    robot.driver.go_to(goal_at(number, 10.0 * number))
    await until(lambda: len(nav2.goals.messages) > before, what=f"goal {number} at Nav2")


async def be_at(number: int, nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    nav2.pose(10.0 * number)
    await robot.hears(PoseReport, lambda report: report.pose.x == 10.0 * number)


def outline(event: DriverEvent) -> str:
    match event:
        case Arrived(generation):
            return f"arrived {generation}"
        case DriveFailed(generation, failure):
            return f"{failure} {generation}"
        case _:
            return type(event).__name__


@pytest.mark.parametrize(
    ("script", "told"),
    [
        ("goal 1 | A:2 | at 1 | A:4", ["arrived 1"]),
        ("goal 1 | A:2 | goal 2 | A:2 B:2 | A:6 B:2 | at 2 | A:6 B:4", ["arrived 2"]),
        ("goal 1 | A:2 | goal 2 | at 2 | A:6 B:4", ["arrived 2"]),
        ("goal 1 | A:1 | A:2 | at 1 | A:4", ["arrived 1"]),
        ("at 1 | goal 1 | A:4", ["arrived 1"]),
        ("goal 1 | E:2 | E:3 | E:5", ["CANCELED_FROM_OUTSIDE 1"]),
        ("goal 1 | E:2 | E:3 | at 1 | E:4", ["arrived 1"]),
        ("goal 1 | A:2 | A:6", ["ABORTED 1"]),
        ("goal 1 | A:6", ["ABORTED 1"]),
        ("goal 1 | A:2 | A:2 X:2 | A:6 X:2", ["TAKEN_OVER 1"]),
        ("goal 1 | A:2 | X:2", ["NAVIGATION_GONE 1"]),
        ("at 1 | goal 1 | A:2 | A:4 | ended | goal 2 | B:2 | at 2 | B:4", ["arrived 1", "arrived 2"]),
        ("goal 1 | A:2 | at 2 | A:4", ["OUTSIDE_TOLERANCE 1"]),
    ],
)
async def test_conversation(script: str, told: list[str], nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    await play(script, nav2, robot)
    await until(lambda: len(robot.ends) == len(told), what=f"{told} (told: {robot.ends})")
    assert [outline(event) for event in robot.ends] == told


async def test_stale_success_in_the_latched_array(nav2: ScriptedNav2, domain_id: int) -> None:
    nav2.array("old:6 older:4")
    nav2.pose(10.0)
    goals = PATIENT.model_copy(update={"settle_time": 2.0})
    async with DrivenRobot(domain_id, goals=goals) as robot:
        await robot.ready()
        robot.driver.go_to(goal_at(1, 10.0))
        await until(lambda: nav2.goals.messages, what="the goal")
        nav2.array("old:6 older:4")
        nav2.array("old:6 older:4 A:2")
        report = await robot.hears(GoalReport, lambda told: told.goal_id == uuid_of("A").hex)
        assert not report.external
        assert robot.ends == []
        nav2.array("old:6 older:4 A:4")
        assert (await robot.hears(Arrived)).generation == 1


async def test_halt_cancels_by_id_and_waits_for_the_end(nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    await play("goal 1 | A:2", nav2, robot)
    await robot.hears(GoalReport)
    robot.driver.halt()
    robot.driver.go_to(goal_at(2, 20.0))
    await until(lambda: nav2.cancels, what="the cancel call")
    nav2.array("A:3")
    await robot.hears(GoalReport, lambda report: report.status == "CANCELING")
    assert robot.ends == []
    assert len(nav2.goals.messages) == 1
    nav2.array("A:5")
    await robot.hears(Halted)
    await until(lambda: len(nav2.goals.messages) == 2, what="the goal after the halt")
    assert set(nav2.cancels) == {uuid_of("A")}


async def test_resent_goal_accepted_twice(nav2: ScriptedNav2, robot: DrivenRobot) -> None:
    for line, status in (("old:2", "EXECUTING"), ("old:5", "CANCELED")):
        nav2.array(line)
        await robot.hears(GoalReport, lambda told, status=status: told.status == status)  # type: ignore[misc]
    robot.driver.go_to(goal_at(1, 10.0))
    await until(lambda: len(nav2.goals.messages) == 2, what="the goal given again")
    await play("old:5 A:2 | old:5 A:6 B:2 | at 1 | old:5 A:6 B:4", nav2, robot)
    await robot.hears(Arrived)
    external = {report.goal_id for report in robot.all(GoalReport) if report.external}
    assert external == {uuid_of("old").hex}
    assert not robot.all(DriveFailed)


async def test_goal_never_accepted(nav2: ScriptedNav2, domain_id: int) -> None:
    async with DrivenRobot(domain_id, goals=QUICK) as robot:
        await robot.ready()
        robot.driver.go_to(goal_at(1, 10.0))
        failed = await robot.hears(DriveFailed)
        assert failed.failure is DriveFailure.NOT_TAKEN_UP
        await until(lambda: len(nav2.goals.messages) == 4, what="each time that it was given")
