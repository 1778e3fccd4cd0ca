"""downloadMap, enableMap and deleteMap, with a real folder and a real web server."""

from __future__ import annotations

from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.actions.plugin import ActionPlugin, RunningAction
from nena_edge_agent.download import DownloadSettings
from nena_edge_agent.extensions.maps.actions import map_actions
from nena_edge_agent.extensions.maps.store import FolderMapStore
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import Map, MapStatus
from support.http_files import Files, served_files
from support.ready_made import end_of
from support.robot_core import action

pytestmark = pytest.mark.clause("6.3")


class Stage:
    def __init__(self, folder: Path, files: Files) -> None:
        first = Map(map_id="hall", map_version="1", map_status=MapStatus.ENABLED)
        self.files = files
        self.store = FolderMapStore(folder, first, maximum=5)
        settings = DownloadSettings(timeout=10, silence=5)
        self.plugins: dict[str, ActionPlugin] = {
            each.declaration.action_type: each for each in map_actions(self.store, settings)
        }
        self.reports: list[ActionReport] = []

    def start(self, action_type: str, version: str, **parameters: Any) -> RunningAction:
        self.reports.clear()
        done = action(
            "a", "NONE", action_type, retriable=None, mapId="hall", mapVersion=version, **parameters
        )
        return self.plugins[action_type].start(done, (), self.reports.append)

    async def play(self, action_type: str, version: str, **parameters: Any) -> ActionReport:
        """Do an action to its end."""
        self.start(action_type, version, **parameters)
        assert self.reports[0].status is ActionStatus.RUNNING
        return await self.end()

    async def end(self) -> ActionReport:
        return await end_of(self.reports)


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with served_files() as files:
        yield Stage(tmp_path, files)


def versions(report: ActionReport) -> dict[str, str]:
    return {each.map_version: each.map_status.value for each in report.maps or ()}


@pytest.mark.clause("6.2.3/downloadMap", "6.2.3/enableMap", "6.2.3/deleteMap")
async def test_a_map_is_downloaded_enabled_and_deleted(stage: Stage) -> None:
    link = stage.files.put("/hall-2", b"walls")

    fetched = await stage.play("downloadMap", "2", mapDownloadLink=link, mapHash=sha256(b"walls").hexdigest())
    assert (fetched.status, versions(fetched)) == (ActionStatus.FINISHED, {"1": "ENABLED", "2": "DISABLED"})
    assert stage.store.content("hall", "2") == b"walls"

    assert versions(await stage.play("enableMap", "2")) == {"1": "DISABLED", "2": "ENABLED"}
    assert versions(await stage.play("deleteMap", "1")) == {"2": "ENABLED"}


@pytest.mark.clause("6.2.3/downloadMap")
async def test_an_existing_map_is_not_downloaded_again(stage: Stage) -> None:
    report = await stage.play("downloadMap", "1", mapDownloadLink="http://127.0.0.1:1/nobody")

    assert report.status is ActionStatus.FAILED
    assert report.error is not None
    assert report.error.error_type == "DUPLICATE_MAP"
    references = {each.reference_key: each.reference_value for each in report.error.error_references}
    assert references == {"actionId": "a", "mapId": "hall", "mapVersion": "1"}


@pytest.mark.clause("6.2.3/enableMap", "6.2.3/deleteMap")
@pytest.mark.parametrize(
    ("action_type", "version"), [("enableMap", "9"), ("deleteMap", "9"), ("deleteMap", "1")]
)
async def test_an_impossible_action_fails_with_a_reason(stage: Stage, action_type: str, version: str) -> None:
    report = await stage.play(action_type, version)

    assert report.status is ActionStatus.FAILED
    assert report.result


@pytest.mark.clause("6.2.3/downloadMap")
async def test_a_broken_link_fails(stage: Stage) -> None:
    report = await stage.play("downloadMap", "2", mapDownloadLink=f"{stage.files.address}/none")

    assert report.status is ActionStatus.FAILED
    assert "404" in (report.result or "")
    assert len(stage.store.maps) == 1


async def test_a_download_can_be_cancelled(stage: Stage) -> None:
    link = stage.files.put("/slow", b"walls")
    stage.files.slow.add("/slow")
    running = stage.start("downloadMap", "2", mapDownloadLink=link)

    running.cancel()

    assert await stage.end() == ActionReport("a", ActionStatus.FAILED, "cancelled")
