from __future__ import annotations

import sys

import pytest

from nena_edge_agent.driver.map_port import MapDriverEvent
from nena_edge_agent.nav2.driver import Nav2Driver
from nena_edge_agent.nav2.settings import RosSettings
from nena_shared.clock import ManualClock
from nena_shared.program import StartError


async def test_machine_without_ros_is_told_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", None)
    told: list[MapDriverEvent] = []
    driver = Nav2Driver(RosSettings(), "hall", told.append, ManualClock())
    with pytest.raises(StartError, match="source the robot's ROS installation"):
        await driver.start()
    await driver.stop()
    assert told == []
