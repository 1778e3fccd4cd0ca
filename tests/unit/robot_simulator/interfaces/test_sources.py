from __future__ import annotations

import os
from pathlib import Path

import pytest

from nena_robot_simulator.interfaces.__main__ import DEFINITIONS
from nena_robot_simulator.interfaces.sources import generate

pytestmark = pytest.mark.ros


def test_generates_what_c_and_python_need(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = dict(os.environ)
    sources = generate(DEFINITIONS, tmp_path)
    os.environ.pop("AMENT_PREFIX_PATH")
    os.environ.update(before)
    python = sources.of("rosidl_generator_py") / "nav2_msgs" / "action"
    assert "NavigateToPose" in (python / "__init__.py").read_text()
    assert "number_of_poses_remaining" in (python / "_navigate_through_poses.py").read_text()
    assert list(sources.of("rosidl_typesupport_fastrtps_c").rglob("*.cpp"))
    assert list(sources.of("rosidl_typesupport_introspection_c").rglob("*visibility_control.h"))
    assert capfd.readouterr().out == ""
