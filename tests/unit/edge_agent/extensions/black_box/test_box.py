"""The black box writes what its robot has sent, received and logged."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from nena_edge_agent.driver.port import Arrived, DriveFailed, DriveFailure
from nena_edge_agent.extensions.black_box.box import FetchRecording, RobotBlackBox, Trigger, Triggers
from nena_edge_agent.extensions.black_box.settings import BlackBoxSettings
from nena_edge_agent.journal import Journal, record_of
from nena_edge_agent.protocol.events import ActionReport, Event, SafetyReport
from nena_shared import log
from nena_shared.clock import SystemClock
from nena_shared.extensions.black_box import box as module
from nena_shared.extensions.black_box.box import Outgoing
from nena_shared.extensions.black_box.folder import OutgoingFolder
from nena_shared.settings import ConfigurationError, LogSettings
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel
from nena_shared.vda5050.state import EmergencyStop
from nena_shared.vda5050.topics import RobotKey
from support.robot_core import Bench, action
from support.waiting import until

ROBOT = RobotKey("ACME", "1")
TOPIC = "uagv/v2/ACME/1/state"
FAILED = DriveFailed(1, DriveFailure.ABORTED, "no path")
STOPPED, RELEASED = SafetyReport(emergency_stop=EmergencyStop.MANUAL), SafetyReport()
QUIET = Arrived(1)


def make_box(folder: Path, interval: float = 60.0) -> RobotBlackBox:
    settings = BlackBoxSettings(enabled=True, delay=0.0, interval=interval)
    outgoing = Outgoing(OutgoingFolder(folder, keep=5, keep_bytes=10**6), None)
    return RobotBlackBox(ROBOT, settings, outgoing, SystemClock())


def topics(path: Path) -> dict[str, list[bytes]]:
    found: dict[str, list[bytes]] = {}
    with path.open("rb") as stream:
        messages: Any = make_reader(stream).iter_messages()
        for _, channel, message in messages:
            found.setdefault(channel.topic, []).append(message.data)
    return found


async def test_a_failed_drive_is_written_with_messages_journal_and_log(tmp_path: Path) -> None:
    log.configure(LogSettings())
    box = make_box(tmp_path / "recordings")
    box.record_message(TOPIC, b'{"headerId":1}')
    journal = Journal(tmp_path / "journal", ROBOT, on_record=box.record_journal)
    journal.read()
    journal.write(record_of(Bench().core.memory()))
    log.get_logger("nena.example").warning("wheel slips")

    box.handle_event(FAILED, Bench().core.robot.errors.entries)
    task = asyncio.create_task(box.run())
    path = await until(lambda: next((tmp_path / "recordings").glob("*.mcap"), None))
    task.cancel()

    assert path.name.endswith("-drive-failed.mcap")
    found = topics(path)
    assert found[TOPIC] == [b'{"headerId":1}']
    assert len(found["/nena/journal"]) == 1
    assert any(b"wheel slips" in each for each in found["/nena/log"])


async def requested(box: RobotBlackBox) -> ActionReport:
    reports: list[ActionReport] = []
    FetchRecording(box).start(action("a", "NONE", "nena:fetchRecording"), (), reports.append)
    return await until(lambda: next((each for each in reports if each.status.ended), None))


async def test_a_requested_recording_is_the_actions_result(tmp_path: Path) -> None:
    report = await requested(make_box(tmp_path))

    assert report.status is ActionStatus.FINISHED
    assert str(report.result).endswith("-request.mcap")
    assert (tmp_path / str(report.result)).exists()


async def test_a_failing_disk_fails_the_action(tmp_path: Path) -> None:
    (tmp_path / "recordings").write_text("a file")

    report = await requested(make_box(tmp_path / "recordings"))

    assert report.status is ActionStatus.FAILED
    assert "upload.folder" in str(report.result)


async def test_a_failing_disk_does_not_end_the_black_box(tmp_path: Path) -> None:
    log.configure(LogSettings())
    place = tmp_path / "recordings"
    place.write_text("a file")
    box = make_box(place, interval=0.0)
    failed, robot = DriveFailed(1, DriveFailure.ABORTED, "no path"), Bench().core.robot
    task = asyncio.create_task(box.run())
    box.handle_event(failed, robot.errors.entries)
    await until(lambda: any("recording not written" in each for each in log.recent_lines()))
    place.unlink()
    box.handle_event(failed, robot.errors.entries)
    await until(lambda: next(place.glob("*.mcap"), None))
    task.cancel()


def test_without_the_library_the_program_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "find_spec", lambda _: None)
    with pytest.raises(ConfigurationError, match=r"nena-edge-agent\[blackbox\]"):
        make_box(tmp_path)


def an_error(level: ErrorLevel, kind: str = "broken") -> ErrorEntry:
    return ErrorEntry(error_type=kind, error_level=level)


def reasons(*events: Event) -> list[Trigger | None]:
    triggers = Triggers()
    return [triggers.check_event(each, ()) for each in events]


def test_a_failed_drive_starts_a_recording() -> None:
    assert reasons(QUIET, FAILED, QUIET) == [None, Trigger.DRIVE_FAILED, None]


def test_an_emergency_stop_starts_one_when_it_begins() -> None:
    assert reasons(STOPPED, STOPPED, RELEASED, STOPPED) == [
        Trigger.EMERGENCY_STOP,
        None,
        None,
        Trigger.EMERGENCY_STOP,
    ]


def test_serious_errors_start_one_when_they_appear() -> None:
    triggers = Triggers()
    warning, fatal = an_error(ErrorLevel.WARNING), an_error(ErrorLevel.FATAL, "motor")
    critical = an_error(ErrorLevel.CRITICAL, "lift")

    assert triggers.check_event(QUIET, (warning,)) is None
    assert triggers.check_event(QUIET, (warning, fatal)) is Trigger.ERROR
    assert triggers.check_event(QUIET, (warning, fatal)) is None
    assert triggers.check_event(QUIET, (fatal, critical)) is Trigger.ERROR
    assert triggers.check_event(QUIET, ()) is None
    assert triggers.check_event(QUIET, (fatal,)) is Trigger.ERROR
