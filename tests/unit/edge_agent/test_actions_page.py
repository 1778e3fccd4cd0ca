"""What docs/actions.md shows works: its settings make actions, and its errors are those that come."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.actions.plugin import PluginContext
from nena_edge_agent.actions.ready_made import ready_made
from nena_edge_agent.actions.robot_ports import LoadSensor
from nena_edge_agent.extension import operation_kinds
from nena_edge_agent.plugin_check import DryDrive, DryRos
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.topics import RobotKey
from support.edge_agent import SETTINGS

PAGE = (Path(__file__).parents[3] / "docs" / "actions.md").read_text(encoding="utf-8")
READY_MADE = PAGE.split("## Ready-made actions")[1].split("## A plug-in of your own")[0]
BLOCKS = re.findall(r"```toml\n(.*?)```", READY_MADE, re.DOTALL)
CONTEXT = PluginContext(RobotKey("ACME", "0001"), DryDrive(), DryRos())


def made(settings: EdgeAgentSettings) -> list[str]:
    plugins = ready_made(settings.operations, CONTEXT, settings.actions, operation_kinds())
    return [each.declaration.action_type for each in plugins]


def test_its_operations_are_valid() -> None:
    types = [made(SETTINGS(**tomllib.loads(block))) for block in BLOCKS]

    assert types[:5] == [
        ["pick"],
        ["clamp"],
        ["waitForDoor", "startCharging", "dock", "setTurnSignal"],
        ["startCharging", "stopCharging", "turn", "backUp"],
        ["assistedTeleopOff"],
    ]


def test_its_load_sensor_is_valid() -> None:
    (block,) = (each for each in BLOCKS if "load_sensor" in each)
    settings = SETTINGS(**tomllib.loads(block))

    assert settings.actions.load_sensor is not None
    LoadSensor(settings.actions.load_sensor, DryRos(), print)


def test_its_plugin_settings_are_valid() -> None:
    block: dict[str, Any] = tomllib.loads(re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)[-1])

    settings = SETTINGS(**block)

    assert settings.actions.plugins == ("forks",)
    assert settings.actions.options == {"forks": {"speed": 0.3}}


def test_a_wrong_field_name_causes_the_documented_error() -> None:
    settings = SETTINGS(**tomllib.loads(BLOCKS[0].replace("{ data =", "{ dat =", 1)))

    with pytest.raises(ConfigurationError) as raised:
        made(settings)

    assert f"setting {raised.value.problems[0]}" in PAGE
    assert len(raised.value.problems) == 1
