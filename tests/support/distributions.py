"""Distributions that tests build and install, each into a separate folder, as pip does for a user."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path


def install(files: Mapping[str, str], folder: Path) -> Path:
    """Write a project into ``folder`` and install its wheel beside it; return the folder for the path."""
    project, site = folder / "project", folder / "site"
    for name, content in files.items():
        file = project / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(content, encoding="utf-8")
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-index",
        "--no-build-isolation",
    ]
    subprocess.run([*pip, "--target", str(site), str(project)], check=True, timeout=120)
    return site


def environment_with(*sites: Path) -> dict[str, str]:
    """Return the environment of a program that finds what is installed in ``sites``."""
    path = os.pathsep.join([*map(str, sites), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    return {**os.environ, "PYTHONPATH": path}
