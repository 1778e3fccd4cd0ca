"""Definitions of ROS message types, with those of the types within them."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from nena_edge_agent.extensions.black_box.ros import SEPARATOR, ros_schema


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of message definitions of a ROS installation with two packages."""
    definitions = {
        "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
        "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec\n",
        "own_msgs/msg/Track": "# All\nstd_msgs/Header header\nPoint[] points # Points\nuint8 LEFT=1\n",
        "own_msgs/msg/Point": "float64 x\nbuiltin_interfaces/Time[2] at\n",
    }
    for name, text in definitions.items():
        path = tmp_path / "share" / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/no/such/folder:{tmp_path}")
    monkeypatch.setattr(sys, "prefix", "/no/such/folder")
    return tmp_path / "share"


def test_a_definition_includes_all_types_once(installed: Path) -> None:
    first, *others = ros_schema("own_msgs/msg/Track").decode().split(f"{SEPARATOR}\n")

    assert first.startswith("# All\n")
    assert [each.splitlines()[0] for each in others] == [
        "MSG: std_msgs/Header",
        "MSG: own_msgs/Point",
        "MSG: builtin_interfaces/Time",
    ]
    assert first.strip() == (installed / "own_msgs/msg/Track.msg").read_text().strip()


def test_a_missing_definition_leaves_the_schema_empty(installed: Path) -> None:
    assert ros_schema("other_msgs/msg/Unknown") == b""
    (installed / "builtin_interfaces/msg/Time.msg").unlink()
    assert ros_schema("own_msgs/msg/Track") == b""
