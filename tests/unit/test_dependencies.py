"""Major versions that break the code are excluded, and locked files are installed as they are."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BOUNDED = ("paho-mqtt",)


def named_in(path: Path) -> list[str]:
    project = tomllib.loads(path.read_text(encoding="utf-8"))["project"]
    extras = project.get("optional-dependencies", {}).values()
    named = [*project.get("dependencies", ()), *(each for extra in extras for each in extra)]
    return [each for each in named if each.startswith(BOUNDED)]


PROJECTS = [path for path in ROOT.glob("*/**/pyproject.toml") if ".venv" not in path.parts]


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: path.parent.name)
def test_mqtt_libraries_have_an_upper_bound(path: Path) -> None:
    assert [each for each in named_in(path) if "<3" not in each] == []


def test_the_mqtt_library_is_a_declared_dependency_of_the_shared_library() -> None:
    assert any(each.startswith("paho-mqtt") for each in named_in(ROOT / "shared/pyproject.toml"))


INSTALLED = [
    ROOT / "Makefile",
    ROOT / "docs/installation.md",
    *ROOT.glob("services/*/Dockerfile*"),
    *ROOT.glob("tools/*/Dockerfile*"),
]


@pytest.mark.parametrize("path", INSTALLED, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_pip_installs_locked_files_without_a_search_for_dependencies(path: Path) -> None:
    commands = re.findall(r"install .*requirements/\S+\.txt", path.read_text(encoding="utf-8"))

    assert commands
    assert [each for each in commands if "--no-deps --require-hashes" not in each] == []
