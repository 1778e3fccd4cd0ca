"""logReport writes what was logged of late."""

from __future__ import annotations

from pathlib import Path

import pytest

from nena_edge_agent.extensions.black_box.log_report import LogReport
from nena_edge_agent.extensions.black_box.settings import LogReportSettings
from nena_edge_agent.protocol.events import ActionReport
from nena_shared import log
from nena_shared.settings import LogSettings
from nena_shared.vda5050.action import ActionStatus
from support.robot_core import action
from support.waiting import until

pytestmark = pytest.mark.clause("6.2.3/logReport")


async def write(folder: Path, *, keep: int = 20) -> ActionReport:
    reports: list[ActionReport] = []
    plugin = LogReport(LogReportSettings(folder=folder, keep=keep))
    plugin.start(action("a", "NONE", "logReport", reason="it hums"), (), reports.append)
    return await until(lambda: next((each for each in reports if each.status.ended), None))


async def test_the_report_contains_the_newest_lines(tmp_path: Path) -> None:
    log.configure(LogSettings())
    log.get_logger("nena.example").warning("stopped", robot="r1")

    report = await write(tmp_path / "reports")

    assert report.status is ActionStatus.FINISHED
    first, *lines = (tmp_path / "reports" / str(report.result)).read_text().splitlines()
    assert first == "log report: it hums"
    assert "[warning  ] stopped " in lines[-1]
    assert lines[-1].endswith(" module=nena.example robot=r1")


def files_of(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


async def test_the_oldest_reports_are_dropped(tmp_path: Path) -> None:
    names = [str((await write(tmp_path, keep=2)).result) for _ in range(3)]

    assert files_of(tmp_path) == names[1:]


async def test_a_failing_disk_fails_the_action(tmp_path: Path) -> None:
    (tmp_path / "reports").write_text("a file")

    report = await write(tmp_path / "reports")

    assert report.status is ActionStatus.FAILED
    assert "not written" in (report.result or "")
