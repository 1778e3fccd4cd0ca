"""Drives of actions by the driver's port, beside those of the core."""

from __future__ import annotations

import asyncio

import pytest

from nena_edge_agent.actions import robot_ports
from nena_edge_agent.actions.plugin import DriveError
from nena_edge_agent.actions.robot_ports import ActionDrive, LoadSensor, Put, RobotPorts
from nena_edge_agent.actions.settings import ActionSettings, LoadSensorSettings
from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    Driver,
    Halted,
    Pose,
    PoseReport,
)
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.protocol.events import Event, LoadSensed
from nena_shared.clock import SystemClock
from nena_shared.settings import ConfigurationError
from support.pausing import turn_passes
from support.ros_port import ScriptedRos
from support.scripted_driver import ScriptedDriver
from support.waiting import PATIENCE, until

PLACE = Pose(1.0, 2.0, 0.5, "hall")


def begun() -> tuple[ActionDrive, ScriptedDriver]:
    drive, driver = ActionDrive(), ScriptedDriver()
    drive.use_driver(driver)
    return drive, driver


async def driving(drive: ActionDrive, driver: ScriptedDriver) -> asyncio.Task[None]:
    before = len(driver.goals)
    task = asyncio.create_task(drive.drive(PLACE, deviation_xy=0.1, maximum_speed=0.3))
    await until(lambda: len(driver.goals) > before)
    return task


async def test_a_drive_ends_with_the_arrival_at_its_own_goal() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    goal = driver.goals[0]
    assert (goal.pose, goal.deviation_xy, goal.maximum_speed) == (PLACE, 0.1, 0.3)
    assert goal.generation < 0  # the core's are above zero

    drive.observe_event(Arrived(1))
    await turn_passes()
    assert not task.done()
    drive.observe_event(Arrived(goal.generation))

    await asyncio.wait_for(task, PATIENCE)


async def test_a_failed_drive_reports_its_reason() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    drive.observe_event(DriveFailed(driver.goals[0].generation, DriveFailure.ABORTED, "a wall"))
    await until(lambda: driver.halts)
    assert not task.done(), "its controller may drive on"
    drive.observe_event(Halted())

    with pytest.raises(DriveError, match=r"a wall \(ABORTED\)"):
        await asyncio.wait_for(task, PATIENCE)


async def test_a_cancelled_action_ends_at_standstill() -> None:
    drive, driver = begun()
    task = await driving(drive, driver)
    task.cancel()
    await until(lambda: driver.halts)
    assert not task.done()
    drive.observe_event(Halted())
    with pytest.raises(asyncio.CancelledError):
        await asyncio.wait_for(task, PATIENCE)

    again = await driving(drive, driver)  # the next one may begin
    assert driver.goals[1].generation < driver.goals[0].generation
    again.cancel()
    driver.on_halt = lambda: drive.observe_event(Halted())
    await asyncio.wait([again], timeout=PATIENCE)


async def test_only_one_action_drives_at_a_time() -> None:
    drive, driver = begun()
    driver.on_halt = lambda: drive.observe_event(Halted())
    task = await driving(drive, driver)
    with pytest.raises(DriveError, match="another action is driving"):
        await drive.drive(PLACE, deviation_xy=0.1)
    task.cancel()
    await asyncio.wait([task], timeout=PATIENCE)


async def test_without_a_driver_a_drive_fails() -> None:
    with pytest.raises(DriveError, match="not ready"):
        await ActionDrive().drive(PLACE, deviation_xy=0.1)


def test_the_pose_is_only_that_of_a_localised_robot() -> None:
    drive, _ = begun()

    def pose(*, localized: bool) -> Pose | None:
        drive.observe_event(PoseReport(PLACE, localized=localized))
        return drive.pose

    assert drive.pose is None
    assert pose(localized=True) == PLACE
    assert pose(localized=False) is None


SETTINGS = LoadSensorSettings(topic="load")


def sensor(settings: LoadSensorSettings = SETTINGS) -> tuple[ScriptedRos, list[bool]]:
    ros, told = ScriptedRos(), []
    LoadSensor(settings, ros, lambda event: told.append(event.loaded))
    return ros, told


async def test_the_load_sensor_reports_each_change() -> None:
    ros, told = sensor()
    for value in (True, True, False, False, True):
        ros.say("load", data=value)

    assert told == [True, False, True]


async def test_an_unchanged_value_is_reported_again_after_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_ports, "REPEAT_INTERVAL", 0.0)
    ros, told = sensor()
    ros.say("load", data=False)
    ros.say("load", data=False)

    assert told == [False, False]


async def test_any_message_type_can_be_a_load_sensor() -> None:
    weight = LoadSensorSettings(topic="scale", type="std_msgs/msg/String", loaded={"data": ["full", "half"]})
    ros, told = sensor(weight)
    ros.say("scale", data="half")
    ros.say("scale", data="empty")

    assert told == [True, False]


def test_an_unknown_message_field_is_an_error_with_its_location() -> None:
    with pytest.raises(
        ConfigurationError, match=r"actions\.load_sensor\.loaded\.dat: std_msgs/msg/Bool has no"
    ):
        LoadSensor(LoadSensorSettings(topic="load", loaded={"dat": True}), ScriptedRos(), print)
    with pytest.raises(ConfigurationError, match=r"actions\.load_sensor\.type: type '.*' is not installed"):
        LoadSensor(LoadSensorSettings(topic="load", type="acme_msgs/msg/Load"), ScriptedRos(), print)


def test_a_robot_without_ros_has_no_sensor() -> None:
    assert RobotPorts(None, ActionSettings(load_sensor=SETTINGS)).ros is None


START = Pose(1.0, 2.0, 0.0, "hall")


async def test_the_ports_are_joined_with_the_driver_when_it_is_created() -> None:
    ros = ScriptedRos()
    ports = RobotPorts(ros, ActionSettings(load_sensor=LoadSensorSettings(topic="load")))
    events: list[Event] = []
    drivers: list[Driver] = []

    def make(put: Put, place: Pose | None) -> Driver:
        assert place is START
        drivers.append(LoopbackDriver(LoopbackSettings(), START, emit=put, clock=SystemClock()))
        return drivers[0]

    assert ports.observe_driver(make)(events.append, START) is drivers[0]
    await drivers[0].start()
    ros.say("load", data=True)

    assert ports.drive.pose == START
    assert isinstance(events[0], PoseReport)
    assert LoadSensed(loaded=True) in events
    await drivers[0].stop()
