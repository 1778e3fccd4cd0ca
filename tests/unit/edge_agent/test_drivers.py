from __future__ import annotations

import sys

import pytest

from nena_edge_agent.actions.ros_session import SessionSwitch
from nena_edge_agent.driver.port import Pose, PoseReport
from nena_edge_agent.drivers import driver_maker
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.nav2.settings import RosSettings
from nena_edge_agent.protocol.events import Event
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.clock import SystemClock
from nena_shared.tasks import StartError

SWITCH = SessionSwitch(RosSettings(), None)


@pytest.mark.parametrize(
    ("last_place", "x"), [(None, 3.0), (Pose(9.0, 0.0, 0.0, "map"), 9.0)], ids=["new", "restarted"]
)
async def test_the_loopback_driver_needs_no_ros_and_starts_at_the_last_position(
    monkeypatch: pytest.MonkeyPatch, last_place: Pose | None, x: float
) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.driver", None)
    settings = EdgeAgentSettings(driver="loopback", loopback=LoopbackSettings(x=3.0))
    events: list[Event] = []

    await driver_maker(settings, 0, SystemClock(), SimulationControl(RobotLink().cut), SWITCH)(
        events.append, last_place
    ).start()

    assert [event.pose.x for event in events if isinstance(event, PoseReport)] == [x]


def test_without_ros_the_nav2_driver_names_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.driver", None)

    with pytest.raises(StartError, match=r"nena-edge-agent\[ros\]"):
        driver_maker(
            EdgeAgentSettings(driver="nav2"), 0, SystemClock(), SimulationControl(RobotLink().cut), SWITCH
        )
