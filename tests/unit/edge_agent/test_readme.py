"""What the README shows works."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from support.edge_agent import SETTINGS

README = Path(__file__).parents[3] / "services" / "edge_agent" / "README.md"


def test_its_settings_are_valid() -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)

    settings = SETTINGS(**tomllib.loads(example))

    assert settings.serial_number == "0001"
    assert [each.action_type for each in settings.operations] == ["pick", "startCharging"]
