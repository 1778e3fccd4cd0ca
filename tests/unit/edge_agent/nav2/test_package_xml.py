"""package.xml has the correct metadata for colcon and rosdep."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import defusedxml.ElementTree
import pytest

FOLDER = Path(__file__).parents[4] / "services" / "edge_agent"
FOR_LAUNCH = {"ros2launch", "launch_xml"}
ROS_IMPORT = re.compile(r"^\s*(?:from|import) (rclpy|\w+_msgs|std_srvs|rcl_interfaces)\b", re.MULTILINE)


@pytest.fixture
def package() -> dict[str, list[str]]:
    tags: dict[str, list[str]] = {}
    text = (FOLDER / "package.xml").read_text(encoding="utf-8")
    for element in defusedxml.ElementTree.fromstring(text):
        tags.setdefault(element.tag, []).append(element.text or "")
    return tags


def test_version_and_description_are_those_of_the_distribution(package: dict[str, list[str]]) -> None:
    project = tomllib.loads((FOLDER / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert package["name"] == [project["name"].replace("-", "_")]
    assert package["version"] == [project["version"]]
    assert package["license"] == [project["license"]]


def test_dependencies_match_the_imports_of_the_sources(package: dict[str, list[str]]) -> None:
    sources = (file.read_text(encoding="utf-8") for file in (FOLDER / "src").rglob("*.py"))
    imported = {name for source in sources for name in ROS_IMPORT.findall(source)}
    assert set(package["exec_depend"]) == imported | FOR_LAUNCH
