"""downloadZoneSet, from a real web server."""

from __future__ import annotations

import json

import pytest

from nena_edge_agent.actions.builtin import ZoneSetDownload
from nena_edge_agent.download import DownloadSettings
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.v3_0 import CODEC
from support.http_files import Files
from support.robot_core import action
from support.waiting import until
from support.zones import transfer, zone, zone_set

pytestmark = pytest.mark.clause("6.2.3/downloadZoneSet")

WALL = zone("wall", "BLOCKED", 4, 6)


async def fetch(link: str) -> ActionReport:
    reports: list[ActionReport] = []
    plugin = ZoneSetDownload(CODEC, DownloadSettings(timeout=10, silence=5))
    wanted = action("a", "NONE", plugin.declaration.action_type, zoneSetId="s1", zoneSetDownloadLink=link)
    plugin.start(wanted, (), reports.append)
    return await until(lambda: next((each for each in reports if each.status.ended), None))


@pytest.mark.parametrize("whole", [True, False])
async def test_a_zone_set_is_read_with_or_without_its_message(files: Files, *, whole: bool) -> None:
    message = json.loads(CODEC.encode(transfer(WALL)))
    link = files.put("/zones", json.dumps(message if whole else message["zoneSet"]).encode())

    report = await fetch(link)

    assert report.status is ActionStatus.FINISHED, report.result
    assert report.zone_set is not None
    assert report.zone_set.zone_set_id == zone_set(WALL).zone_set_id
    assert [each.zone_id for each in report.zone_set.zones] == ["wall"]


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b'"x"', b"\xff", b'{"zoneSet": 3}', b"[" * 100_000])
async def test_an_invalid_zone_set_fails(files: Files, content: bytes) -> None:
    report = await fetch(files.put("/zones", content))

    assert report.status is ActionStatus.FAILED
    assert report.zone_set is None
    assert report.result
    assert "plug-in" not in report.result


async def test_a_zone_set_with_another_id_fails(files: Files) -> None:
    message = CODEC.encode(transfer(WALL, zone_set_id="s2"))

    report = await fetch(files.put("/zones", message))

    assert (report.status, "'s2'" in (report.result or "")) == (ActionStatus.FAILED, True)


async def test_a_broken_link_fails(files: Files) -> None:
    report = await fetch(f"{files.address}/none")

    assert report.status is ActionStatus.FAILED
