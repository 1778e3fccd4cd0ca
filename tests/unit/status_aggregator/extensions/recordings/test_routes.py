"""``/api/v1/recordings``: the list and the files."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path

import httpx
import pytest
from fastapi import FastAPI

from nena_shared.extensions.black_box.transfer import Transfer
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.api import problems
from nena_status_aggregator.extensions.recordings.routes import make_router
from nena_status_aggregator.extensions.recordings.store import RecordingSettings, RecordingStore

NAME = "20260102T030405.678Z-drive-failed.mcap"


def client(store: RecordingStore | None) -> httpx.AsyncClient:
    app = FastAPI()
    problems.install(app)
    app.include_router(make_router(store))
    return httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://aggregator")


@pytest.fixture
def store(tmp_path: Path) -> RecordingStore:
    made = RecordingStore(RecordingSettings(folder=tmp_path))
    for serial, content in (("r1", b"first"), ("r2", b"second")):
        transfer = Transfer(NAME, len(content), sha256(content).hexdigest())
        made.add_chunk(RobotKey("ACME", serial), transfer.chunk(content))
    return made


async def test_recordings_are_listed_for_all_robots_or_one(store: RecordingStore) -> None:
    async with client(store) as http:
        every = (await http.get("/api/v1/recordings")).json()
        (one,) = (await http.get("/api/v1/recordings", params={"robot": "ACME/r2"})).json()

    assert {each["robot"] for each in every} == {"ACME/r1", "ACME/r2"}
    assert (one["name"], one["size"]) == (NAME, 6)
    assert one["received"].endswith("Z")


async def test_a_file_is_downloaded_under_its_name(store: RecordingStore) -> None:
    async with client(store) as http:
        answer = await http.get(f"/api/v1/recordings/ACME/r1/{NAME}")

    assert answer.content == b"first"
    assert NAME in answer.headers["content-disposition"]


@pytest.mark.parametrize(
    "path", ["ACME/r1/other.mcap", "ACME/r3/x.mcap", "ACME/r1/..%2F..%2Fx.mcap", "a/b/c"]
)
async def test_unknown_files_are_not_found(store: RecordingStore, path: str) -> None:
    async with client(store) as http:
        assert (await http.get(f"/api/v1/recordings/{path}")).status_code == 404


async def test_disabled_recordings_say_so() -> None:
    async with client(None) as http:
        answer = await http.get("/api/v1/recordings")

    assert answer.status_code == 404
    assert "recordings.enabled" in answer.json()["detail"]
