from __future__ import annotations

from math import pi

import pytest
from pydantic import ValidationError

from nena_edge_agent.actions.robot_ports import ActionDrive
from nena_edge_agent.driver.port import Arrived, Halted, Pose, PoseReport
from nena_edge_agent.extensions.action_kinds.docking import Docking, offset_pose
from nena_edge_agent.extensions.action_kinds.settings import DockOperationSettings
from nena_edge_agent.plugin_check import DryDrive
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from support.robot_core import action
from support.scripted_driver import ScriptedDriver
from support.waiting import until


@pytest.mark.parametrize(
    ("theta", "ahead", "left", "turn", "place"),
    [
        (0.0, 0.5, 0.0, 0.0, (1.5, 2.0, 0.0)),
        (pi / 2, 0.5, 0.0, 0.0, (1.0, 2.5, pi / 2)),
        (0.0, -0.5, 0.0, 0.0, (0.5, 2.0, 0.0)),
        (pi / 2, 0.0, 1.0, 0.0, (0.0, 2.0, pi / 2)),
        (pi, 1.0, 1.0, -pi / 2, (0.0, 1.0, pi / 2)),
    ],
)
def test_the_offset_is_in_the_robots_own_frame(
    theta: float, ahead: float, left: float, turn: float, place: tuple[float, float, float]
) -> None:
    there = offset_pose(Pose(1.0, 2.0, theta, "hall"), ahead, left, turn)

    assert (there.x, there.y, there.theta) == pytest.approx(place)
    assert there.map_id == "hall"


def docking(**settings: object) -> tuple[Docking, DryDrive]:
    drive = DryDrive()
    full = {"kind": "dock", "action_type": "dock", "forward": 0.8, **settings}
    return Docking(DockOperationSettings.model_validate(full), drive), drive


async def end(plugin: Docking, **parameters: float) -> ActionReport:
    reports: list[ActionReport] = []
    plugin.start(action("a", "HARD", "dock", **parameters), (), reports.append)  # type: ignore[arg-type]
    return await until(lambda: next((each for each in reports if each.status.ended), None))


async def test_it_drives_the_configured_distance() -> None:
    plugin, drive = docking()

    assert (await end(plugin)).status == "FINISHED"
    assert drive.pose is not None
    assert drive.pose.x == pytest.approx(0.8)


async def test_an_order_may_set_the_distance_within_limits() -> None:
    plugin, drive = docking(adjustable=True)
    too_far = plugin.declaration.problem(action("a", "HARD", "dock", forward=0.9), ActionScope.NODE)
    assert too_far == "action 'dock': parameter 'forward' must be at least -0.8 and at most 0.8"

    assert (await end(plugin, forward=-0.2)).status == "FINISHED"
    assert drive.pose is not None
    assert drive.pose.x == pytest.approx(-0.2)


async def test_a_paused_drive_continues_to_the_same_pose() -> None:
    drive, driver = ActionDrive(), ScriptedDriver()
    driver.on_halt = lambda: drive.observe_event(Halted())
    drive.use_driver(driver)
    drive.observe_event(PoseReport(Pose(0.0, 0.0, 0.0, "hall"), localized=True))
    settings = DockOperationSettings(kind="dock", action_type="dock", forward=1.0)
    reports: list[ActionReport] = []
    running = Docking(settings, drive).start(action("a", "HARD", "dock"), (), reports.append)
    await until(lambda: driver.goals)

    running.pause()
    await until(lambda: reports[-1].status is ActionStatus.PAUSED)
    assert driver.halts == 1
    drive.observe_event(PoseReport(Pose(0.4, 0.0, 0.0, "hall"), localized=True))
    running.resume()
    await until(lambda: len(driver.goals) == 2)
    assert driver.goals[1].pose == driver.goals[0].pose
    drive.observe_event(Arrived(driver.goals[1].generation))
    await until(lambda: reports[-1].status is ActionStatus.FINISHED)

    assert [each.status.value for each in reports] == ["RUNNING", "PAUSED", "RUNNING", "FINISHED"]


@pytest.mark.parametrize("held", [True, False])
async def test_a_cancelled_drive_is_reported_at_standstill(*, held: bool) -> None:
    drive, driver = ActionDrive(), ScriptedDriver()
    drive.use_driver(driver)
    drive.observe_event(PoseReport(Pose(0.0, 0.0, 0.0, "hall"), localized=True))
    settings = DockOperationSettings(kind="dock", action_type="dock")
    reports: list[ActionReport] = []
    running = Docking(settings, drive).start(action("a", "HARD", "dock"), (), reports.append)
    await until(lambda: driver.goals)
    if held:
        running.pause()
        await until(lambda: driver.halts)
        drive.observe_event(Halted())
        await until(lambda: reports[-1].status is ActionStatus.PAUSED)
    running.cancel()
    await until(lambda: driver.halts)
    assert not reports[-1].status.ended
    drive.observe_event(Halted())
    await until(lambda: reports[-1].status.ended)

    assert reports[-1].result == "cancelled"
    assert driver.halts == 1


async def test_a_robot_that_is_not_localised_does_not_dock() -> None:
    plugin, drive = docking()
    drive.pose = None

    report = await end(plugin)
    assert (report.status, report.result) == ("FAILED", "the robot is not localised")


@pytest.mark.parametrize("settings", [{"scopes": ["EDGE"]}, {"blocking_types": ["NONE", "HARD"]}])
def test_it_requires_a_blocking_type_that_stops_the_order(settings: dict[str, object]) -> None:
    with pytest.raises(ValidationError, match="SOFT or HARD"):
        docking(**settings)
