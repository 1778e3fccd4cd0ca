"""Commands as a person writes them, and what the robot gets to feel of them."""

from __future__ import annotations

import json
from math import inf
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import Circle, NavigationReport, NoRouteReport, Pose, PoseReport
from nena_edge_agent.loopback.control import CommandRefusedError, SimulationControl, parse_command
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.protocol.events import (
    ErrorSwitched,
    Event,
    LocalTrigger,
    OperatingModeSwitched,
    PauseButton,
    SafetyReport,
)
from nena_edge_agent.robot_link import RobotLink
from nena_shared.clock import SystemClock
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference
from nena_shared.vda5050.state import EmergencyStop, OperatingMode


class Stand:
    def __init__(self) -> None:
        self.events: list[Event] = []
        self.cuts: list[float] = []
        self.control = SimulationControl(self.cuts.append)
        start = Pose(0.0, 0.0, 0.0, "m")
        settings = LoopbackSettings()
        self.driver = LoopbackDriver(settings, start, emit=self.events.append, clock=SystemClock())
        self.control.use_driver(self.driver, self.events.append)

    def do(self, command: str, **fields: Any) -> Event:
        """Execute a command, and return the last resulting event."""
        self.control.apply_command(parse_command(json.dumps({"command": command, **fields}).encode()))
        return self.events[-1]


def test_commands_of_people_are_passed_to_the_core() -> None:
    stand = Stand()

    assert stand.do("operatingMode", mode="SERVICE") == OperatingModeSwitched(OperatingMode.SERVICE)
    assert stand.do("pauseButton", pressed=True) == PauseButton(pressed=True)
    assert stand.do("trigger") == LocalTrigger("LOCAL")
    assert stand.do("trigger", triggerType="door") == LocalTrigger("door")


def test_an_error_has_its_references() -> None:
    told = Stand().do("error", errorType="worn", errorLevel="URGENT", errorReferences={"part": "belt"})

    reference = ErrorReference(reference_key="part", reference_value="belt")
    entry = ErrorEntry(error_type="worn", error_level=ErrorLevel.URGENT, error_references=(reference,))
    assert told == ErrorSwitched(entry, active=True)


def test_emergency_stop_and_field_violation_are_reported_together() -> None:
    stand = Stand()

    assert stand.do("fieldViolation", active=True) == SafetyReport(field_violation=True)
    assert stand.do("emergencyStop", stop="REMOTE") == SafetyReport(
        EmergencyStop.REMOTE, field_violation=True
    )
    assert stand.do("fieldViolation", active=False) == SafetyReport(EmergencyStop.REMOTE)
    assert stand.do("acknowledgeEmergencyStop") == SafetyReport()


def test_simulated_events_are_passed_to_the_driver() -> None:
    stand = Stand()

    assert stand.do("navigation", available=False) == NavigationReport(
        available=False, reason="switched off by simulation control"
    )
    assert stand.do("navigation", available=True, reason="x") == NavigationReport(available=True, reason="")
    assert stand.do("noRoute", x=3, y=4) == NoRouteReport((Circle(3, 4, 0.5),))
    assert stand.do("noRoute", x=3, y=4, active=False) == NoRouteReport(())
    assert stand.do("noRoute") == NoRouteReport((Circle(0, 0, inf),))
    carried = stand.do("pose", x=1, y=2, theta=0.5, mapId="cellar")
    assert isinstance(carried, PoseReport)
    assert carried.pose == Pose(1, 2, 0.5, "cellar")


def test_the_link_is_cut_for_the_given_time() -> None:
    stand = Stand()
    stand.control.apply_command(parse_command(b'{"command": "linkSilence", "seconds": 2.5}'))

    assert stand.cuts == [2.5]


async def test_commands_are_refused_while_the_robot_does_not_run() -> None:
    stand, press = Stand(), parse_command(b'{"command": "pauseButton", "pressed": true}')
    with pytest.raises(CommandRefusedError, match="is not running"):
        SimulationControl(RobotLink().cut).apply_command(press)

    await stand.driver.stop()
    with pytest.raises(CommandRefusedError, match="is not running"):
        stand.control.apply_command(press)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "command: Invalid JSON"),
        ("{}", "Unable to extract tag"),
        ('{"command": "pose", "x": 1}', "pose.y: is missing"),
        ('{"command": "pose", "x": 1e999, "y": 0}', "pose.x: Input should be a finite number"),
        ('{"command": "battery", "stateOfCharge": 101}', "less than or equal to 100"),
        ('{"command": "battery", "state_of_charge": 10}', "battery.stateOfCharge: is missing"),
        ('{"command": "unreachable", "x": 1}', "specify both x and y, or neither"),
    ],
)
def test_an_invalid_command_reports_its_problem(text: str, problem: str) -> None:
    with pytest.raises(CommandRefusedError) as caught:
        parse_command(text.encode())

    assert problem in str(caught.value)


@given(st.binary(max_size=50) | st.from_regex(r'\{"command": "[a-z]{0,8}", ".*\}').map(str.encode))
def test_random_bytes_only_cause_a_refusal(payload: bytes) -> None:
    with pytest.raises(CommandRefusedError):
        parse_command(payload)
