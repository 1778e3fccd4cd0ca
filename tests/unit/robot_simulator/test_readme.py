"""What the README shows works."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from nena_robot_simulator.settings import SimulatorSettings

README = Path(__file__).parents[3] / "tools" / "robot_simulator" / "README.md"


def test_the_settings_that_it_shows_are_settings() -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    settings = SimulatorSettings(**tomllib.loads(example))
    assert [robot.name for robot in settings.robots] == ["alpha", "beta"]
