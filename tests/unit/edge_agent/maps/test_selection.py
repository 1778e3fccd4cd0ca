"""Which map store the settings name."""

from __future__ import annotations

from pathlib import Path

import pytest

from nena_edge_agent.maps.selection import map_store
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.topics import RobotKey

ROBOT = RobotKey("ACME", "r.1")


def settings(**maps: object) -> EdgeAgentSettings:
    return EdgeAgentSettings.model_validate({"map_id": "hall", "map_version": "7", "maps": maps})


def test_a_robot_has_its_one_map_unless_told_otherwise() -> None:
    assert map_store(settings(), ROBOT) is None


def test_each_robot_has_a_folder_of_its_own(tmp_path: Path) -> None:
    one = map_store(settings(store="folder", folder=tmp_path), ROBOT)
    two = map_store(settings(store="folder", folder=tmp_path), RobotKey("ACME", "r2"))

    assert one is not None
    assert two is not None
    assert [(each.map_id, each.map_version) for each in one.maps] == [("hall", "7")]
    assert len(list(tmp_path.iterdir())) == 2


def test_a_plug_in_that_is_not_installed_is_an_error_of_the_settings() -> None:
    with pytest.raises(ConfigurationError, match=r"nena\.maps"):
        map_store(settings(store="acme_map_server"), ROBOT)
