from __future__ import annotations

from pathlib import Path

from nena_edge_agent.ros.address import RosAddress
from nena_edge_agent.ros.session_store import SessionStore
from nena_edge_agent.ros.settings import RosSettings
from nena_shared.vda5050.topics import RobotKey

ROBOT = RobotKey("ACME", "1/a")
SETTINGS = RosSettings(namespace="/r1", domain_id=7)
NEW = RosAddress("/r2", 9)


def test_what_was_written_is_read(tmp_path: Path) -> None:
    store = SessionStore(tmp_path / "journal", ROBOT)
    assert store.read(SETTINGS) == RosAddress("/r1", 7)
    store.write(NEW, SETTINGS)
    assert SessionStore(tmp_path / "journal", ROBOT).read(SETTINGS) == NEW
    assert SessionStore(tmp_path / "journal", RobotKey("ACME", "2")).read(SETTINGS) == RosAddress("/r1", 7)


def test_settings_that_were_changed_since_count(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, ROBOT)
    store.write(NEW, SETTINGS)
    assert store.read(RosSettings(namespace="/r1", domain_id=8)) == RosAddress("/r1", 8)


def test_a_file_that_cannot_be_read_is_as_none(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, ROBOT)
    store.write(NEW, SETTINGS)
    (file,) = tmp_path.iterdir()
    file.write_text('{"address": {"namespace": "/r-2", "domain_id": 9}}')
    assert store.read(SETTINGS) == RosAddress("/r1", 7)
