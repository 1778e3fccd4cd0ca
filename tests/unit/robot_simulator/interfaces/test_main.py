from __future__ import annotations

import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import NoReturn

import pytest

from nena_robot_simulator.interfaces import __main__ as program
from nena_robot_simulator.interfaces import build
from support.action_types import needs_action_types

pytestmark = pytest.mark.ros


def found(monkeypatch: pytest.MonkeyPatch, origin: Path | None) -> None:
    """Make the package be found at ``origin``, or not at all."""
    spec = ModuleSpec("nav2_msgs", None, origin=str(origin)) if origin else None
    monkeypatch.setattr(program, "find_spec", lambda _name: spec)


def no_compilation(*_: object) -> NoReturn:
    pytest.fail("something is generated")


@needs_action_types
def test_types_that_are_up_to_date_cost_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(build, "generate", no_compilation)
    assert program.main() == 0
    assert capsys.readouterr().err == ""


def test_types_of_a_ros_installation_are_left_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "__init__.py").write_text("")
    found(monkeypatch, tmp_path / "__init__.py")
    monkeypatch.setattr(build, "generate", no_compilation)
    assert program.main() == 0
    assert "already installed" in capsys.readouterr().err


@pytest.mark.parametrize("obstacle", ["not in a virtual", "of the ROS wheels", "no gcc"])
def test_what_keeps_types_from_being_made_is_told_and_is_no_failure(
    obstacle: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found(monkeypatch, None)
    monkeypatch.setattr(build, "generate", no_compilation)
    monkeypatch.setattr(build, "missing_tool", lambda: "there is no gcc")
    if obstacle != "no gcc":
        monkeypatch.setattr(sys, "prefix", sys.base_prefix if "virtual" in obstacle else str(tmp_path))
    assert program.main() == 0
    assert obstacle in capsys.readouterr().err


def test_a_compiler_that_refuses_is_a_failure(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object) -> NoReturn:
        raise build.CompilationError("libx.so", "x.c:1: error")

    found(monkeypatch, None)
    monkeypatch.setattr(build, "missing_tool", lambda: None)
    monkeypatch.setattr(build, "generate", lambda *_: None)
    monkeypatch.setattr(build, "build", refuse)
    assert program.main() == 1
    assert "x.c:1: error" in capsys.readouterr().err
