"""The port of plug-ins without a session; with one it is shown over DDS in the integration tests."""

from __future__ import annotations

import pytest

from nena_edge_agent.actions.plugin import RosError
from nena_edge_agent.actions.ros_port import PluginRos

STRING = "std_msgs/msg/String"


def test_without_a_session_nobody_listens_and_nothing_is_sent() -> None:
    port = PluginRos()
    publisher = port.publisher("lift", STRING)

    assert publisher.listeners == 0
    with pytest.raises(RosError, match="the robot's ROS session is not active"):
        publisher.publish({"data": "up"})


async def test_without_a_session_no_service_is_called() -> None:
    client = PluginRos().client("clamp", "std_srvs/srv/Trigger")

    with pytest.raises(RosError, match="the robot's ROS session is not active"):
        await client.call({}, seconds=1.0)


async def test_what_does_not_fit_is_refused_before_anything_else() -> None:
    port = PluginRos()

    with pytest.raises(RosError, match=r"lift\.date: std_msgs/msg/String has no such field"):
        port.publisher("lift", STRING).publish({"date": "up"})
    with pytest.raises(RosError, match=r"clamp\.data: 1 is not true or false"):
        await port.client("clamp", "std_srvs/srv/SetBool").call({"data": 1}, seconds=1.0)
    with pytest.raises(RosError, match="there is no type"):
        port.subscribe("lift", "acme_msgs/msg/Lift", print)
