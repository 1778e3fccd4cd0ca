from __future__ import annotations

import os
from pathlib import Path

import pytest

from nena_robot_simulator.__main__ import ros_environment


def test_what_is_missing_is_set_and_the_log_directory_goes_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for name in ("FASTDDS_BUILTIN_TRANSPORTS", "ROS_PYTHON_CHECK_FIELDS", "ROS_LOG_DIR"):
        monkeypatch.setenv(name, "to be restored")
        monkeypatch.delenv(name)
    with ros_environment():
        assert os.environ["FASTDDS_BUILTIN_TRANSPORTS"] == "UDPv4"
        assert os.environ["ROS_PYTHON_CHECK_FIELDS"] == "1"
        directory = Path(os.environ["ROS_LOG_DIR"])
        (directory / "some.log").write_text("line")
    assert not directory.exists()
    assert "ROS_LOG_DIR" not in os.environ


def test_what_the_user_has_set_stays(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("FASTDDS_BUILTIN_TRANSPORTS", "LARGE_DATA")
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    with ros_environment():
        assert os.environ["FASTDDS_BUILTIN_TRANSPORTS"] == "LARGE_DATA"
        assert os.environ["ROS_LOG_DIR"] == str(tmp_path)
    assert os.environ["ROS_LOG_DIR"] == str(tmp_path)
    assert tmp_path.exists()
