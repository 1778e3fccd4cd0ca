from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.actions.ros_session import SessionSwitch, session_actions, session_switch
from nena_edge_agent.driver.port import SessionError, SessionReport
from nena_edge_agent.nav2.session_control import SessionManager
from nena_edge_agent.nav2.settings import RosAddress, RosSettings
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.own_actions import CONFIGURE_ROS_SESSION, START_ROS_SESSION, STOP_ROS_SESSION
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.robot_core import action
from support.waiting import until

SETTINGS = RosSettings(namespace="/r1", domain_id=7)
ROBOT = RobotKey("ACME", "1")


class Robot:
    """A robot's session and its actions; the graph admits all except ``closed``."""

    def __init__(self, journal: Path | None = None) -> None:
        self.closed: set[int] = set()
        self.told: list[SessionReport] = []
        self.switch = session_switch(SETTINGS, journal, ROBOT)
        self.manager = SessionManager(
            self.switch.address,
            begin=self._begin,
            end=self._end,
            on_change=self.told.append,
            clock=ManualClock(),
            retry=1.0,
        )
        self.switch.use_session(self.manager)

    async def _begin(self, address: RosAddress) -> None:
        if address.domain_id in self.closed:
            raise SessionError("no network")

    async def _end(self) -> None:
        pass

    async def does(self, action_type: str, **parameters: Any) -> ActionReport:
        return await done(self.switch, action_type, **parameters)


async def done(switch: SessionSwitch, action_type: str, **parameters: Any) -> ActionReport:
    """Execute an action, and return its end."""
    (plugin,) = (each for each in session_actions(switch) if each.declaration.action_type == action_type)
    told: list[ActionReport] = []
    plugin.start(action("a", action_type=action_type, **parameters), (), told.append)
    await until(lambda: told and told[-1].status.ended, what="the end of the action")
    return told[-1]


async def test_start_and_stop_report_the_session_state() -> None:
    robot = Robot()
    report = await robot.does(START_ROS_SESSION)
    assert report == ActionReport("a", ActionStatus.FINISHED, "ROS session ACTIVE, namespace /r1, domain 7")
    report = await robot.does(STOP_ROS_SESSION)
    assert report.result == "ROS session NOT_ACTIVE, namespace /r1, domain 7"


async def test_a_repeated_start_or_stop_succeeds() -> None:
    robot = Robot()
    for action_type in (START_ROS_SESSION, START_ROS_SESSION, STOP_ROS_SESSION, STOP_ROS_SESSION):
        assert (await robot.does(action_type)).status is ActionStatus.FINISHED
    assert len(robot.told) == 4


async def test_a_failed_start_reports_its_reason() -> None:
    robot = Robot()
    robot.closed = {7}
    report = await robot.does(START_ROS_SESSION)
    assert report.status is ActionStatus.FAILED
    reason, _, after = (report.result or "").partition("; retried")
    assert reason == "the ROS session has failed: no network; namespace /r1, domain 7"
    assert after


async def test_configure_changes_the_given_values_until_a_restart(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    await robot.does(START_ROS_SESSION)
    report = await robot.does(CONFIGURE_ROS_SESSION, namespace="r2")
    assert report.result == "ROS session ACTIVE, namespace /r2, domain 7"
    assert Robot(tmp_path).manager.address == RosAddress("/r1", 7)


async def test_configure_stores_the_address_on_request(tmp_path: Path) -> None:
    await Robot(tmp_path).does(CONFIGURE_ROS_SESSION, namespace="r2", domainId=9, keep=True)
    robot = Robot(tmp_path)
    assert robot.manager.address == RosAddress("/r2", 9)
    await robot.does(CONFIGURE_ROS_SESSION, namespace="/r1", domainId=7, keep=True)
    assert Robot(tmp_path).manager.address == RosAddress("/r1", 7)


async def test_the_current_address_can_be_stored_without_a_new_session(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    await robot.does(START_ROS_SESSION)
    await robot.does(CONFIGURE_ROS_SESSION, domainId=9)
    told = len(robot.told)
    await robot.does(CONFIGURE_ROS_SESSION, domainId=9, keep=True)
    assert len(robot.told) == told
    assert Robot(tmp_path).manager.address == RosAddress("/r1", 9)


@pytest.mark.parametrize(
    ("parameters", "problem"),
    [
        ({}, "namespace or domainId required"),
        ({"namespace": "r-1"}, "letters, digits and underscores"),
        ({"domainId": 233}, "less than or equal to 232"),
        ({"domainId": 9, "keep": True}, "journal.enabled is false"),
    ],
)
async def test_an_invalid_configure_reports_the_problem_and_changes_nothing(
    parameters: dict[str, Any], problem: str
) -> None:
    robot = Robot()
    await robot.does(START_ROS_SESSION)
    report = await robot.does(CONFIGURE_ROS_SESSION, **parameters)
    assert report.status is ActionStatus.FAILED
    assert problem in (report.result or "")
    assert (robot.manager.address, len(robot.told)) == (RosAddress("/r1", 7), 2)


async def test_an_address_that_cannot_be_stored_is_reported_and_not_used(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    robot = Robot(tmp_path / "file")
    report = await robot.does(CONFIGURE_ROS_SESSION, domainId=9, keep=True)
    assert report.status is ActionStatus.FAILED
    assert "unchanged" in (report.result or "")
    assert robot.manager.address == RosAddress("/r1", 7)


async def test_an_address_is_stored_even_if_its_session_fails_to_start(tmp_path: Path) -> None:
    robot = Robot(tmp_path)
    await robot.does(START_ROS_SESSION)
    robot.closed = {9}
    report = await robot.does(CONFIGURE_ROS_SESSION, domainId=9, keep=True)
    assert report.status is ActionStatus.FAILED
    assert "retried until it is stopped" in (report.result or "")
    assert Robot(tmp_path).manager.address == robot.manager.address == RosAddress("/r1", 9)


async def test_without_a_driver_session_actions_fail() -> None:
    report = await done(SessionSwitch(SETTINGS, None), START_ROS_SESSION)
    assert report == ActionReport("a", ActionStatus.FAILED, "the robot has not started yet")


def test_stopping_or_configuring_a_session_requires_an_idle_robot() -> None:
    needs = {
        each.declaration.action_type: each.declaration.needs_idle
        for each in session_actions(SessionSwitch(SETTINGS, None))
    }
    assert needs == {START_ROS_SESSION: False, STOP_ROS_SESSION: True, CONFIGURE_ROS_SESSION: True}
