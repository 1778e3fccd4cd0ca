from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import ValidationError

from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.program import DESCRIPTION, PROGRAM
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.settings import ConfigurationError, load
from support.edge_agent import SETTINGS


def loaded(*argv: str) -> EdgeAgentSettings:
    return load(SETTINGS, argv, program=PROGRAM, description=DESCRIPTION)


def test_by_default_it_is_one_robot_with_nav2() -> None:
    settings = loaded()

    assert (settings.driver, settings.interface_name, settings.version) == ("nav2", None, "2.1.0")
    assert settings.serial_numbers == ("robot1",)
    assert [each.action_type for each in settings.operations] == [
        "pick",
        "drop",
        "startCharging",
        "stopCharging",
    ]


def test_a_loopback_fleet_has_numbered_serials() -> None:
    settings = loaded("--driver", "loopback", "--loopback.count", "3", "--serial_number", "r")

    assert settings.serial_numbers == ("r-1", "r-2", "r-3")
    assert [settings.loopback.start(index).x for index in range(3)] == [0.0, 2.0, 4.0]


def test_only_loopback_robots_can_be_a_fleet() -> None:
    assert loaded("--loopback.count", "3").serial_numbers == ("robot1",)


def test_start_poses_can_be_set_per_robot() -> None:
    settings = SETTINGS.model_validate(
        {"loopback": {"count": 2, "spacing": 1.0, "starts": [{"x": 7.0, "theta": 1.0}]}}
    )

    assert (settings.loopback.start(0).x, settings.loopback.start(0).theta) == (7.0, 1.0)
    assert settings.loopback.start(1).x == 1.0


def test_operations_are_read_from_tables_of_the_file(tmp_path: Path) -> None:
    file = tmp_path / "agent.toml"
    file.write_text('[[operations]]\naction_type = "lift"\nseconds = 2\nload = "take"\n')

    settings = loaded("--config", str(file))

    assert settings.operations == (OperationSettings(action_type="lift", seconds=2.0, load="take"),)


@pytest.mark.parametrize(
    "argv",
    [
        ("--serial_number", "a/b"),
        ("--serial_number", "a\nb"),
        ("--tolerated_parameters", "edges.trajectori"),
        ("--mqtt.host", ""),
        ("--mqtt.reconnect_min", "inf"),
        ("--manufacturer", "a+b"),
        ("--interface_name", "/x"),
        ("--interval.state_maximum", "31"),
        ("--interval.state_minimum", "5", "--interval.state_maximum", "1"),
        ("--version", "1.1.0"),
        ("--loopback.speed", "0"),
        ("--qos", "2"),
    ],
)
def test_an_invalid_value_is_named(argv: tuple[str, ...]) -> None:
    with pytest.raises(ConfigurationError) as problem:
        loaded(*argv)

    assert argv[0].strip("-").split(".")[0] in problem.value.problems[0]


@pytest.mark.parametrize("qos", [0, 1])
def test_the_quality_of_service_is_set_on_the_command_line(qos: int) -> None:
    assert loaded("--qos", str(qos)).qos == qos


def test_settings_are_immutable() -> None:
    with pytest.raises(ValidationError):
        loaded().serial_number = "x"  # type: ignore[misc]  # that is the point
