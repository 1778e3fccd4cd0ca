"""Drives of actions by the driver's port, beside those of the core."""

from __future__ import annotations

import asyncio

import pytest

from nena_edge_agent.actions.drive import ActionDrive
from nena_edge_agent.actions.ports import DriveError
from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    Halted,
    Pose,
    PoseReport,
)
from support.pausing import turn_passes
from support.scripted_driver import ScriptedDriver
from support.waiting import PATIENCE, until

PLACE = Pose(1.0, 2.0, 0.5, "hall")


def begun() -> tuple[ActionDrive, ScriptedDriver]:
    drive, driver = ActionDrive(), ScriptedDriver()
    drive.attach(driver)
    return drive, driver


async def driving(drive: ActionDrive, driver: ScriptedDriver) -> asyncio.Task[None]:
    before = len(driver.goals)
    task = asyncio.create_task(drive.drive(PLACE, deviation_xy=0.1, maximum_speed=0.3))
    await until(lambda: len(driver.goals) > before)
    return task


async def test_it_ends_with_the_arrival_of_its_own_goal() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    goal = driver.goals[0]
    assert (goal.pose, goal.deviation_xy, goal.maximum_speed) == (PLACE, 0.1, 0.3)
    assert goal.generation < 0  # the core's are above zero

    drive.hear(Arrived(1))
    await turn_passes()
    assert not task.done()
    drive.hear(Arrived(goal.generation))

    await asyncio.wait_for(task, PATIENCE)


async def test_a_drive_that_fails_says_why() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    drive.hear(DriveFailed(driver.goals[0].generation, DriveFailure.ABORTED, "a wall"))

    with pytest.raises(DriveError, match=r"a wall \(ABORTED\)"):
        await asyncio.wait_for(task, PATIENCE)


async def test_one_that_is_given_up_ends_when_the_robot_stands() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    task.cancel()
    await until(lambda: driver.halts)
    assert not task.done()
    drive.hear(Halted())
    with pytest.raises(asyncio.CancelledError):
        await asyncio.wait_for(task, PATIENCE)

    again = await driving(drive, driver)  # the next one may begin
    assert driver.goals[1].generation < driver.goals[0].generation
    again.cancel()
    driver.on_halt = lambda: drive.hear(Halted())
    await asyncio.wait([again], timeout=PATIENCE)


async def test_two_cannot_drive_at_a_time() -> None:
    drive, driver = begun()
    driver.on_halt = lambda: drive.hear(Halted())
    task = await driving(drive, driver)
    with pytest.raises(DriveError, match="another action drives"):
        await drive.drive(PLACE, deviation_xy=0.1)
    task.cancel()
    await asyncio.wait([task], timeout=PATIENCE)


async def test_without_a_driver_nothing_drives() -> None:
    with pytest.raises(DriveError, match="not there yet"):
        await ActionDrive().drive(PLACE, deviation_xy=0.1)


def test_the_pose_is_one_that_can_be_trusted() -> None:
    drive, _ = begun()

    def pose(*, localized: bool) -> Pose | None:
        drive.hear(PoseReport(PLACE, localized=localized))
        return drive.pose

    assert drive.pose is None
    assert pose(localized=True) == PLACE
    assert pose(localized=False) is None
