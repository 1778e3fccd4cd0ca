"""The program as a user starts it."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped

from support.ros import LATCHED, RosPeer
from support.simulator import SimulatorProcess, goal, publisher_to, trace
from support.waiting import wait_until

pytestmark = pytest.mark.ros

STATUS = "navigate_to_pose/_action/status"


def settings_file(directory: Path, domain_id: int) -> str:
    file = directory / "simulator.toml"
    file.write_text(
        f"""
        time_factor = 5
        [[robots]]
        name = "alpha"
        namespace = "r1"
        domain_id = {domain_id}
        [[robots]]
        name = "beta"
        namespace = "r2"
        domain_id = {domain_id}
        start = {{ y = 3 }}
        """,
        encoding="utf-8",
    )
    return str(file)


@pytest.mark.parametrize("stop_signal", [signal.SIGTERM, signal.SIGINT])
def test_two_robots_drive_and_the_program_exits_cleanly(
    tmp_path: Path, domain_id: int, peer: RosPeer, stop_signal: signal.Signals
) -> None:
    scratch = tmp_path / "tmp"
    scratch.mkdir()
    began = time.monotonic()
    with SimulatorProcess("--config", settings_file(tmp_path, domain_id), directory=scratch) as process:
        process.wait_for_line("robot ready", "robot=alpha", "namespace=/r1", f"domain_id={domain_id}")
        process.wait_for_line("robot ready", "robot=beta", "namespace=/r2")
        to_start = time.monotonic() - began
        arrays = [peer.subscribe(GoalStatusArray, f"/{name}/{STATUS}", LATCHED) for name in ("r1", "r2")]
        for name in ("r1", "r2"):
            publisher_to(peer, PoseStamped, "goal_pose", name).publish(goal(1.0, 3.0))
        for inbox in arrays:
            inbox.wait_for(lambda array: array.status_list[0].status == 4)
            assert set(trace(inbox.messages)) <= {"A:2", "A:4"}
        process.stop(stop_signal)
        asked = time.monotonic()
        assert process.ended() == 0
        assert time.monotonic() - asked < 2.0 + to_start
    assert list(scratch.iterdir()) == []
    wait_until(lambda: peer.node.count_publishers(f"/r1/{STATUS}") == 0, what="an orderly farewell")


def test_settings_come_from_the_environment_too(
    tmp_path: Path, domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NENA_FAULTS", '[{"kind": "stuck"}]')
    with SimulatorProcess("--config", settings_file(tmp_path, domain_id), directory=tmp_path) as process:
        process.wait_for_line("fault", "kind=stuck", "robot=beta")
        process.stop(signal.SIGTERM)
        assert process.ended() == 0


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("--config", "missing.toml"), "missing.toml"),
        (("--robots", '{"domain_id": 300}'), "robots.0.domain_id"),
        (("--faults", '{"kind": "explode"}'), "explode"),
    ],
)
def test_invalid_settings_end_the_program_with_one_line(
    tmp_path: Path, arguments: tuple[str, ...], problem: str
) -> None:
    with SimulatorProcess(*arguments, directory=tmp_path) as process:
        assert process.ended() == 2
        assert len(process.lines) == 1
        assert process.lines[0].startswith("nena-robot-simulator: ")
        assert problem in process.lines[0]


def test_continues_after_being_frozen(tmp_path: Path, domain_id: int, peer: RosPeer) -> None:
    with SimulatorProcess("--config", settings_file(tmp_path, domain_id), directory=tmp_path) as process:
        process.wait_for_line("robot ready", "robot=beta")
        process.stop(signal.SIGSTOP)
        wait_until(lambda: process.frozen, what="the freeze")
        process.stop(signal.SIGCONT)
        statuses = peer.subscribe(GoalStatusArray, f"/r1/{STATUS}", LATCHED)
        publisher_to(peer, PoseStamped, "goal_pose", "r1").publish(goal(1.0, 0.0))
        statuses.wait_for(lambda array: array.status_list[0].status == 4)


@pytest.mark.long
def test_twenty_robots_drive_in_one_process(tmp_path: Path, domain_id: int, peer: RosPeer) -> None:
    options = ("--time_factor", "5", "--copies", "20")
    robots = f'[{{"name": "agv", "domain_id": {domain_id}, "start": {{"y": -10.0}}}}]'
    with SimulatorProcess(*options, "--robots", robots, directory=tmp_path) as process:
        process.wait_for_line("robot ready", "robot=agv-20", "namespace=/r20")
        names = [f"r{number}" for number in range(1, 21)]
        arrays = [peer.subscribe(GoalStatusArray, f"/{name}/{STATUS}", LATCHED) for name in names]
        for number, name in enumerate(names):
            publisher_to(peer, PoseStamped, "goal_pose", name).publish(goal(3.0, number - 10.0))
        for inbox in arrays:
            inbox.wait_for(lambda array: array.status_list[0].status == 4)
            assert set(trace(inbox.messages)) <= {"A:2", "A:4"}
        process.stop(signal.SIGTERM)
        assert process.ended() == 0
