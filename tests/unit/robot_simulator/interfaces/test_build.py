from __future__ import annotations

import os
import shutil
import sysconfig
from pathlib import Path

import pytest

from nena_robot_simulator.interfaces import build
from nena_robot_simulator.interfaces.__main__ import PACKAGES
from nena_robot_simulator.interfaces.build import Sources, generate

pytestmark = pytest.mark.ros


@pytest.fixture
def definitions(tmp_path: Path) -> Path:
    """Return two definitions of the package: reading all of them takes a minute."""
    made = tmp_path / PACKAGES[0].name
    for name in ("NavigateToPose", "NavigateThroughPoses"):
        (made / "action").mkdir(parents=True, exist_ok=True)
        shutil.copy(PACKAGES[0] / "action" / f"{name}.action", made / "action")
    return made


def test_generates_what_c_and_python_need(
    definitions: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = dict(os.environ)
    sources = generate(definitions, tmp_path / "generated")
    os.environ.pop("AMENT_PREFIX_PATH")
    os.environ.update(before)
    python = sources.of("rosidl_generator_py") / "nav2_msgs" / "action"
    assert "NavigateToPose" in (python / "__init__.py").read_text()
    assert "number_of_poses_remaining" in (python / "_navigate_through_poses.py").read_text()
    assert list(sources.of("rosidl_typesupport_fastrtps_c").rglob("*.cpp"))
    assert list(sources.of("rosidl_typesupport_introspection_c").rglob("*visibility_control.h"))
    assert capfd.readouterr().out == ""


def test_says_which_compiler_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "gcc" in str(build.missing_tool())


def test_says_that_the_headers_of_python_are_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for tool in ("gcc", "g++"):
        (tmp_path / tool).write_text("#!/bin/sh\n")
        (tmp_path / tool).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sysconfig, "get_path", lambda _name: str(tmp_path))
    assert "Python.h" in str(build.missing_tool())


@pytest.mark.skipif(build.missing_tool() is not None, reason=str(build.missing_tool()))
def test_tells_what_the_compiler_says(tmp_path: Path) -> None:
    sources = Sources("nonsense", tmp_path)
    folder = sources.of("rosidl_generator_c")
    folder.mkdir()
    (folder / "nonsense.c").write_text("no language at all")
    with pytest.raises(build.CompilationError, match="nonsense") as caught:
        build.build(sources, tmp_path / "built")
    assert "error:" in caught.value.output


@pytest.mark.skipif(build.missing_tool() is not None, reason=str(build.missing_tool()))
def test_a_compiler_that_takes_too_long_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build, "LONGEST_COMPILATION", 0.0)
    sources = Sources("slow", tmp_path)
    folder = sources.of("rosidl_generator_c")
    folder.mkdir()
    (folder / "slow.c").write_text("")
    with pytest.raises(build.CompilationError, match="not compiled within 0 s"):
        build.build(sources, tmp_path / "built")


def test_puts_everything_in_its_place_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sources, built, prefix = Sources("some_msgs", tmp_path / "src"), tmp_path / "built", tmp_path / "prefix"
    python = sources.of("rosidl_generator_py") / "some_msgs" / "action"
    for path in (python, built, prefix):
        path.mkdir(parents=True)
    (python / "__init__.py").write_text("")
    for name in ("libsome_msgs__rosidl_generator_c.so", "some_msgs_s__rosidl_typesupport_c.so"):
        (built / name).write_text("")
    monkeypatch.setattr(sysconfig, "get_path", lambda _name: str(prefix / "site"))
    monkeypatch.setattr("sys.prefix", str(prefix))
    build.install(sources, built, "mark")
    assert sorted(str(path.relative_to(prefix)) for path in prefix.rglob("*") if path.is_file()) == [
        "lib/libsome_msgs__rosidl_generator_c.so",
        "site/some_msgs/__init__.py",
        "site/some_msgs/action/__init__.py",
        "site/some_msgs/some_msgs_s__rosidl_typesupport_c.so",
    ]
    assert "mark" in (prefix / "site/some_msgs/__init__.py").read_text()
