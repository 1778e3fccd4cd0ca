from __future__ import annotations

from nena_edge_agent.actions.robot_ports import Put, RobotPorts
from nena_edge_agent.actions.settings import ActionSettings, LoadSensorSettings
from nena_edge_agent.driver.port import Driver, Pose, PoseReport
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.protocol.events import Event, LoadSensed
from nena_shared.clock import SystemClock
from support.ros_port import ScriptedRos

START = Pose(1.0, 2.0, 0.0, "hall")


async def test_they_are_joined_with_the_driver_when_that_is_made() -> None:
    ros = ScriptedRos()
    ports = RobotPorts(ros, ActionSettings(load_sensor=LoadSensorSettings(topic="load")))
    events: list[Event] = []
    drivers: list[Driver] = []

    def make(put: Put, place: Pose | None) -> Driver:
        assert place is START
        drivers.append(LoopbackDriver(LoopbackSettings(), START, emit=put, clock=SystemClock()))
        return drivers[0]

    assert ports.joined(make)(events.append, START) is drivers[0]
    await drivers[0].start()
    ros.say("load", data=True)

    assert ports.drive.pose == START
    assert isinstance(events[0], PoseReport)
    assert LoadSensed(loaded=True) in events
    await drivers[0].stop()
