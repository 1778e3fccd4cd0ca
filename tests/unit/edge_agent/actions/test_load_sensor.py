from __future__ import annotations

import pytest

from nena_edge_agent.actions import load_sensor
from nena_edge_agent.actions.load_sensor import LoadSensor
from nena_edge_agent.actions.robot_ports import RobotPorts
from nena_edge_agent.actions.settings import ActionSettings, LoadSensorSettings
from nena_edge_agent.protocol.events import LoadSensed
from nena_shared.settings import ConfigurationError
from support.ros_port import ScriptedRos

SETTINGS = LoadSensorSettings(topic="load")


def sensor(settings: LoadSensorSettings = SETTINGS) -> tuple[ScriptedRos, list[bool]]:
    ros, told = ScriptedRos(), []
    made = LoadSensor(settings, ros)

    def tell(event: LoadSensed) -> None:
        told.append(event.loaded)

    made.tell = tell
    return ros, told


async def test_it_tells_of_each_change() -> None:
    ros, told = sensor()
    for value in (True, True, False, False, True):
        ros.say("load", data=value)

    assert told == [True, False, True]


async def test_it_tells_the_same_again_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(load_sensor, "AGAIN_AFTER", 0.0)
    ros, told = sensor()
    ros.say("load", data=False)
    ros.say("load", data=False)

    assert told == [False, False]


async def test_any_message_may_say_so() -> None:
    weight = LoadSensorSettings(topic="scale", type="std_msgs/msg/String", loaded={"data": ["full", "half"]})
    ros, told = sensor(weight)
    ros.say("scale", data="half")
    ros.say("scale", data="empty")

    assert told == [True, False]


def test_a_field_that_the_message_does_not_have_is_an_error_with_its_place() -> None:
    with pytest.raises(
        ConfigurationError, match=r"actions\.load_sensor\.loaded\.dat: std_msgs/msg/Bool has no"
    ):
        LoadSensor(LoadSensorSettings(topic="load", loaded={"dat": True}), ScriptedRos())
    with pytest.raises(ConfigurationError, match=r"actions\.load_sensor\.type: there is no type"):
        LoadSensor(LoadSensorSettings(topic="load", type="acme_msgs/msg/Load"), ScriptedRos())


def test_a_robot_without_ros_has_no_sensor() -> None:
    assert RobotPorts(None, ActionSettings(load_sensor=SETTINGS)).ros is None
