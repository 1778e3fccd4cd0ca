from __future__ import annotations

import sysconfig
from pathlib import Path

import pytest

from nena_robot_simulator.interfaces import libraries
from nena_robot_simulator.interfaces.sources import Sources

pytestmark = pytest.mark.ros


def test_says_which_compiler_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "gcc" in str(libraries.missing_tool())


def test_says_that_the_headers_of_python_are_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for tool in ("gcc", "g++"):
        (tmp_path / tool).write_text("#!/bin/sh\n")
        (tmp_path / tool).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(sysconfig, "get_path", lambda _name: str(tmp_path))
    assert "Python.h" in str(libraries.missing_tool())


@pytest.mark.skipif(libraries.missing_tool() is not None, reason=str(libraries.missing_tool()))
def test_tells_what_the_compiler_says(tmp_path: Path) -> None:
    sources = Sources("nonsense", tmp_path)
    folder = sources.of("rosidl_generator_c")
    folder.mkdir()
    (folder / "nonsense.c").write_text("no language at all")
    with pytest.raises(libraries.CompilationError, match="nonsense") as caught:
        libraries.build(sources, tmp_path / "built")
    assert "error:" in caught.value.output


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
    libraries.install(sources, built, "mark")
    assert sorted(str(path.relative_to(prefix)) for path in prefix.rglob("*") if path.is_file()) == [
        "lib/libsome_msgs__rosidl_generator_c.so",
        "site/some_msgs/__init__.py",
        "site/some_msgs/action/__init__.py",
        "site/some_msgs/some_msgs_s__rosidl_typesupport_c.so",
    ]
    assert "mark" in (prefix / "site/some_msgs/__init__.py").read_text()
