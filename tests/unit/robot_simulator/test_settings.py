from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from nena_robot_simulator import faults
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings, StartPose
from nena_shared.settings import ConfigurationError, load


def read(path: Path, text: str, *arguments: str) -> SimulatorSettings:
    file = path / "simulator.toml"
    file.write_text(text, encoding="utf-8")
    return load(SimulatorSettings, ["--config", str(file), *arguments], program="simulator", description="")


def test_without_settings_there_is_one_robot() -> None:
    settings = SimulatorSettings()
    assert [(robot.domain_id, robot.namespace) for robot in settings.robots] == [(0, "")]


def test_robots_and_their_faults_stand_in_the_file(tmp_path: Path) -> None:
    settings = read(
        tmp_path,
        """
        time_factor = 4
        [[robots]]
        name = "alpha"
        namespace = "/hall_2/r1"
        domain_id = 12
        start = { x = 1, y = 2.5, yaw = 3 }
        drive = { speed = 2 }
        [[robots.faults]]
        kind = "unreachable"
        circles = [{ x = 1, y = 1, radius = 2 }]
        [[robots]]
        name = "beta"
        namespace = "r2"
        domain_id = 12
        """,
        "--time_factor",
        "8",
    )
    alpha, beta = settings.robots
    assert settings.time_factor == 8.0
    assert (alpha.namespace, alpha.start.y, alpha.drive.speed, alpha.drive.acceleration) == (
        "hall_2/r1",
        2.5,
        2.0,
        1.0,
    )
    assert alpha.faults == (faults.Unreachable(circles=(faults.Circle(x=1, y=1, radius=2),)),)
    assert (beta.name, beta.faults) == ("beta", ())


def test_a_fault_is_given_on_the_command_line(tmp_path: Path) -> None:
    settings = read(tmp_path, "", "--faults", '{"kind": "stuck"}')
    assert settings.faults == (faults.Stuck(),)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("robots = []", "robots is empty"),
        ("[[robots]]\ndomain_id = 233", "robots.0.domain_id"),
        ("[[robots]]\ndomain_id = -1", "robots.0.domain_id"),
        ('[[robots]]\nnamespace = "robot-1"', "letters, digits and underscores"),
        ('[[robots]]\nnamespace = "a//b"', "letters, digits and underscores"),
        ('[[robots]]\nnamespace = "a/"', "letters, digits and underscores"),
        ('[[robots]]\nnamespace = "1a"', "letters, digits and underscores"),
        ("[[robots]]\nstart = { x = nan }", "robots.0.start.x"),
        ("[[robots]]\n[[robots]]\ndomain_id = 1", "duplicate robot name 'robot1'"),
        ('[[robots]]\nname = "a"\n[[robots]]\nname = "b"', "two robots share domain 0 and namespace ''"),
        ("time_factor = 0", "time_factor"),
        ("map = { min_x = 5, max_x = 5 }", "at most 1000 m"),
        ('faults = [{ kind = "explode" }]', "explode"),
        ("speed = 3", "speed"),
    ],
)
def test_settings_that_make_no_simulator_are_refused_with_the_reason(
    tmp_path: Path, text: str, problem: str
) -> None:
    with pytest.raises(ConfigurationError) as caught:
        read(tmp_path, text)
    assert any(problem in line for line in caught.value.problems)


def test_copies_are_robots_in_namespaces_or_domains_of_their_own() -> None:
    robot = RobotSettings(name="agv", domain_id=5, start=StartPose(x=1.0, y=2.0))
    beside = SimulatorSettings(robots=(robot,), copies=3).all_robots
    assert [(each.name, each.namespace, each.domain_id, each.start.y) for each in beside] == [
        ("agv-1", "r1", 5, 2.0),
        ("agv-2", "r2", 5, 3.0),
        ("agv-3", "r3", 5, 4.0),
    ]
    apart = SimulatorSettings(robots=(robot,), copies=2, separate_domains=True).all_robots
    assert [(each.namespace, each.domain_id) for each in apart] == [("", 5), ("", 6)]
    assert len(SimulatorSettings(robots=(robot,)).all_robots) == 1


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"copies": 2, "robots": [{"name": "a"}, {"name": "b", "namespace": "b"}]}, "exactly one robot"),
        ({"copies": 2, "separate_domains": True, "robots": [{"domain_id": 232}]}, "2 copies from domain ID"),
    ],
)
def test_copies_that_cannot_be_made(settings: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValidationError, match=problem):
        SimulatorSettings(**settings)
