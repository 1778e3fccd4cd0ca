# noqa: INP001 - it stands beside the package
"""For colcon alone: it builds Python packages by setup.py, in the way of ament. pip uses pyproject.toml."""

import tomllib
from pathlib import Path

from setuptools import Distribution, find_packages, setup  # type: ignore[import-untyped]  # no stubs

PROJECT = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["project"]


class AmentDistribution(Distribution):  # type: ignore[misc]  # for want of stubs
    """Leaves pyproject.toml alone: colcon, and the setuptools of ROS 2 Jazzy, stumble over its metadata."""

    def parse_config_files(
        self, filenames: list[str] | None = None, *, ignore_option_errors: bool = False
    ) -> None:
        """Read setup.cfg and nothing else."""
        super().parse_config_files(filenames or ["setup.cfg"], ignore_option_errors)


setup(
    distclass=AmentDistribution,
    name="nena_edge_agent",
    version=PROJECT["version"],
    description=PROJECT["description"],
    license=PROJECT["license"],
    package_dir={"": "src"},
    packages=find_packages("src"),
    package_data={"nena_edge_agent": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/nena_edge_agent"]),
        ("share/nena_edge_agent", ["package.xml"]),
        ("share/nena_edge_agent/launch", ["launch/edge_agent.launch.xml"]),
        ("share/nena_edge_agent/config", ["config/edge_agent.toml"]),
    ],
    entry_points={
        group: [f"{name} = {target}" for name, target in entries.items()]
        for group, entries in {"console_scripts": PROJECT["scripts"], **PROJECT["entry-points"]}.items()
    },
)
