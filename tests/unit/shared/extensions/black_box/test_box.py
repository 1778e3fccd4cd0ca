"""The black box writes at most one file for many failures."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from nena_shared.extensions.black_box.box import BlackBox, Outgoing, Source, outgoing_of
from nena_shared.extensions.black_box.folder import OutgoingFolder
from nena_shared.extensions.black_box.settings import OutgoingSettings, RingSettings
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import end
from nena_shared.vda5050.topics import RobotKey
from support.clocks import ManualClock
from support.pausing import turn_passes

SOURCE = Source(RobotKey("ACME", "1"), "nena-shared")


def make_box(folder: Path, clock: ManualClock, **settings: float) -> BlackBox:
    outgoing = Outgoing(OutgoingFolder(folder, keep=5, keep_bytes=10**6), None)
    return BlackBox(SOURCE, RingSettings.model_validate(settings), outgoing, clock)


def test_repeated_failures_start_one_recording_in_each_interval(tmp_path: Path) -> None:
    clock = ManualClock()
    box = make_box(tmp_path, clock, interval=10.0)
    started = []
    for second in range(25):
        clock.seconds = float(second)
        box.fail("error")
        if not box._due.empty():
            started.append((second, box._due.get_nowait()))

    assert started == [(0, "error"), (10, "error"), (20, "error")]


async def test_files_are_counted(tmp_path: Path) -> None:
    place = tmp_path / "recordings"
    place.write_text("no folder")
    box = make_box(place, ManualClock())
    with pytest.raises(OSError, match="recordings"):
        await box.request()
    place.unlink()
    name = await box.request()

    assert (place / name).exists()
    outcomes = box.outgoing.counts.outcomes
    assert (outcomes["written"], outcomes["not_written"]) == (1, 1)


async def test_requests_that_arrive_meanwhile_get_the_same_file(tmp_path: Path) -> None:
    box = make_box(tmp_path, ManualClock())
    names = await asyncio.gather(*(box.request() for _ in range(6)))

    assert len({*names}) == 1
    assert box.outgoing.counts.outcomes["written"] == 1


async def test_a_failure_is_written_even_if_the_black_box_is_started_again_meanwhile(tmp_path: Path) -> None:
    box = make_box(tmp_path, ManualClock(), delay=5.0)
    box.fail("error")
    first = asyncio.create_task(box.run())
    await turn_passes()
    await end(first)

    assert box._due.get_nowait() == "error"


def test_each_source_has_a_folder_of_its_own(tmp_path: Path) -> None:
    settings, topics = OutgoingSettings(folder=tmp_path), FleetTopics()
    made = [outgoing_of(settings, RobotKey("ACME", each), topics) for each in ("r.1", "r2")]
    for each in made:
        each.folder.add("1.log", Path.touch)

    assert sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*.log")) == [
        "ACME%2Fr%2E1/1.log",
        "ACME%2Fr2/1.log",
    ]
    assert [each.uploader for each in made] == [None, None]


def test_without_a_home_the_setting_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "expanduser", lambda _: (_ for _ in ()).throw(RuntimeError("no home")))
    with pytest.raises(ConfigurationError, match=r"upload\.folder: no home"):
        outgoing_of(OutgoingSettings(), RobotKey("ACME", "1"), FleetTopics())
