from __future__ import annotations

import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import ModuleType

import pytest

from nena_edge_agent.driver.map_port import MapDriverEvent, MapGoal, MapPose, MapPoseReport
from nena_edge_agent.driver.port import DriveFailed, DriveFailure, NavigationReport
from nena_edge_agent.nav2.driver import Nav2Driver, Nav2Options
from nena_edge_agent.nav2.map_server import MapServer
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.settings import RosSettings
from nena_edge_agent.nav2.speed_limit import SpeedLimiter
from nena_shared.clock import ManualClock
from nena_shared.program import StartError
from support.pausing import turn_passes

READING = PoseReading(1.0, 2.0, 0.5, "map", 1, 0.01, 0.01, 0.01)


async def test_machine_without_ros_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", None)
    told: list[MapDriverEvent] = []
    driver = Nav2Driver(RosSettings(), "hall", told.append, ManualClock())
    with pytest.raises(StartError, match="source the robot's ROS installation"):
        await driver.start()
    await driver.stop()
    assert told == []


@asynccontextmanager
async def started(
    monkeypatch: pytest.MonkeyPatch, told: list[MapDriverEvent], options: Nav2Options
) -> AsyncIterator[Nav2Driver]:
    """Run a driver outside of the ROS graph."""
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", ModuleType("node"))
    driver = Nav2Driver(RosSettings(start_session=False), "hall", told.append, ManualClock(), options)
    await driver.start()
    try:
        yield driver
    finally:
        await driver.stop()


def goal(generation: int) -> MapGoal:
    return MapGoal(generation, MapPose(1.0, 0.0, 0.0, "hall"), 0.3, None, maximum_speed=0.4)


@pytest.mark.parametrize("generation", [-1, 1])
async def test_a_goal_with_a_limit_that_no_controller_hears_is_answered(
    monkeypatch: pytest.MonkeyPatch, generation: int
) -> None:
    told: list[MapDriverEvent] = []
    options = Nav2Options(limiter=SpeedLimiter("speed_limit", 1.0))
    async with started(monkeypatch, told, options) as driver:
        driver.go_to(goal(generation))
        await turn_passes()
    failed = [each for each in told if isinstance(each, DriveFailed)]
    reasons = [each.reason for each in told if isinstance(each, NavigationReport)]
    if generation < 0:
        assert [each.failure for each in failed] == [DriveFailure.NOT_TAKEN_UP]
    else:
        assert not failed
        assert any("no node listens to speed_limit" in each for each in reasons)


async def test_a_place_of_the_map_before_does_not_count_after_a_restart(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    mark = tmp_path / "unplaced"
    mark.touch()
    server = MapServer(RosSettings(), "attic")
    server.remember(mark)
    told: list[MapDriverEvent] = []
    async with started(monkeypatch, told, Nav2Options(map_server=server)) as driver:
        driver._on_pose(READING)
        await turn_passes()
    poses = [each for each in told if isinstance(each, MapPoseReport)]
    assert [each.localized for each in poses] == [False]
    assert "its position there is not set" in poses[0].problem
    assert mark.exists()
