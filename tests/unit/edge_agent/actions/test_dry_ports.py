from __future__ import annotations

import pytest

from nena_edge_agent.actions.dry_ports import DryDrive, DryRos
from nena_edge_agent.actions.ports import RosError
from nena_edge_agent.driver.port import Pose


async def test_messages_must_fit_and_services_succeed() -> None:
    ros = DryRos()
    publisher = ros.publisher("lift", "std_msgs/msg/String")
    publisher.publish({"data": "up"})
    assert publisher.listeners == 1
    with pytest.raises(RosError, match="no such field"):
        publisher.publish({"date": "up"})

    clamp = ros.client("clamp", "std_srvs/srv/SetBool")
    assert await clamp.call({"data": True}, seconds=1.0) == {"success": True, "message": ""}
    assert await ros.client("clear", "std_srvs/srv/Empty").call({}, seconds=1.0) == {}
    with pytest.raises(RosError, match="not true or false"):
        await clamp.call({"data": 1}, seconds=1.0)


def test_types_must_be_there() -> None:
    ros = DryRos()
    for ask in (
        lambda: ros.publisher("x", "acme_msgs/msg/Lift"),
        lambda: ros.subscribe("x", "acme_msgs/msg/Lift", print),
        lambda: ros.client("x", "acme_msgs/srv/Lift"),
    ):
        with pytest.raises(RosError, match="there is no type"):
            ask()


async def test_drives_arrive() -> None:
    drive = DryDrive()
    await drive.drive(Pose(1.0, 2.0, 0.0, "map"), deviation_xy=0.1)

    assert drive.pose == Pose(1.0, 2.0, 0.0, "map")
