"""Failures start a recording, once."""

from __future__ import annotations

from nena_edge_agent.black_box.triggers import Reason, Triggers
from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure
from nena_edge_agent.protocol.events import Event, SafetyReport
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import EmergencyStop

FAILED = DriveFailed(1, DriveFailure.ABORTED, "no path")
STOPPED, RELEASED = SafetyReport(emergency_stop=EmergencyStop.MANUAL), SafetyReport()
QUIET = Arrived(1)


def an_error(level: ErrorLevel, kind: str = "broken") -> ErrorEntry:
    return ErrorEntry(error_type=kind, error_level=level)


def reasons(*events: Event) -> list[Reason | None]:
    triggers = Triggers()
    return [triggers.note(each, ()) for each in events]


def test_a_failed_drive_starts_a_recording() -> None:
    assert reasons(QUIET, FAILED, QUIET) == [None, Reason.DRIVE_FAILED, None]


def test_an_emergency_stop_starts_one_when_it_begins() -> None:
    assert reasons(STOPPED, STOPPED, RELEASED, STOPPED) == [
        Reason.EMERGENCY_STOP,
        None,
        None,
        Reason.EMERGENCY_STOP,
    ]


def test_serious_errors_start_one_when_they_appear() -> None:
    triggers = Triggers()
    warning, fatal = an_error(ErrorLevel.WARNING), an_error(ErrorLevel.FATAL, "motor")
    critical = an_error(ErrorLevel.CRITICAL, "lift")

    assert triggers.note(QUIET, (warning,)) is None
    assert triggers.note(QUIET, (warning, fatal)) is Reason.ERROR
    assert triggers.note(QUIET, (warning, fatal)) is None
    assert triggers.note(QUIET, (fatal, critical)) is Reason.ERROR
    assert triggers.note(QUIET, ()) is None
    assert triggers.note(QUIET, (fatal,)) is Reason.ERROR
