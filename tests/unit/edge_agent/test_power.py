"""The commands that hibernate, wake and shut down a robot, run as real programs."""

from __future__ import annotations

import asyncio
import os
import signal
import tempfile
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from structlog.testing import capture_logs

from nena_edge_agent import power as commands
from nena_edge_agent.doctor.finding import Link, LinkVerdict
from nena_edge_agent.doctor.program import judge_power
from nena_edge_agent.power import OUTPUT_LOGGED, PowerSettings, run_command
from nena_edge_agent.protocol.declaration import HIBERNATION, POWER_ACTIONS
from nena_edge_agent.protocol.events import PowerCommand
from nena_edge_agent.settings import EdgeAgentSettings
from support.waiting import PATIENCE, until

SHUTDOWN = frozenset({"shutdown"})


def power(*command: str, timeout: float = 60.0) -> PowerSettings:
    return PowerSettings(shutdown_command=command, command_timeout=timeout)


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        ((), ""),
        (("true",), ""),
        (("sh", "-c", "exit 7"), "sh ended with exit code 7"),
        (("sh", "-c", "kill -9 $$"), "sh was ended by signal 9"),
        (("/no/such/program",), "/no/such/program cannot be started: No such file or directory"),
        (("/etc/passwd",), "/etc/passwd cannot be started: Permission denied"),
    ],
)
async def test_the_end_of_a_command_is_reported(command: tuple[str, ...], problem: str) -> None:
    assert await run_command(power(*command), PowerCommand.SHUT_DOWN) == problem


async def test_a_command_that_hangs_is_killed() -> None:
    problem = await run_command(power("sleep", "3600", timeout=0.05), PowerCommand.SHUT_DOWN)

    assert problem == "sleep did not end within 0.05 s"


async def test_the_robot_wakes_although_the_output_cannot_be_stored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/nonexistent")
    waking = PowerSettings(hibernate_command=("true",), wake_command=("sh", "-c", "echo too hot; exit 3"))

    assert await run_command(waking, PowerCommand.WAKE) == "sh ended with exit code 3"


@pytest.mark.parametrize("refusal", [PermissionError, ProcessLookupError, None])
async def test_the_robot_wakes_although_its_command_cannot_be_killed(
    monkeypatch: pytest.MonkeyPatch, refusal: type[OSError] | None
) -> None:
    """Such as one of another user (sudo), or one that waits for a device."""
    left: list[int] = []

    def kill(group: int, _: int) -> None:
        left.append(group)
        if refusal:
            raise refusal

    waking = PowerSettings(hibernate_command=("true",), wake_command=("sleep", "3600"), command_timeout=0.05)
    try:
        with monkeypatch.context() as patched:
            patched.setattr(os, "killpg", kill)
            patched.setattr(commands, "KILL_TIMEOUT", 0.05)
            problem = await asyncio.wait_for(run_command(waking, PowerCommand.WAKE), PATIENCE)
    finally:
        (group,) = left
        os.killpg(group, signal.SIGKILL)

    assert problem == "sleep did not end within 0.05 s and cannot be killed"
    await until(lambda: not _runs(Path(f"/proc/{group}/stat")), what="the command has ended")


async def test_a_cancelled_command_is_killed_with_its_child_processes(
    tmp_path: Path,
) -> None:
    started = tmp_path / "started"
    command = power("sh", "-c", f"sleep 3600 & echo $! > {started}.new; mv {started}.new {started}; wait")
    task = asyncio.create_task(run_command(command, PowerCommand.SHUT_DOWN))
    await until(started.exists)

    task.cancel()
    await asyncio.wait([task])

    child = Path("/proc") / started.read_text().strip() / "stat"
    await until(lambda: not _runs(child), what="the child has ended")


def _runs(stat: Path) -> bool:
    """Return whether a process is neither gone nor a zombie."""
    try:
        return ") Z " not in stat.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False


async def test_a_child_process_that_continues_does_not_delay_the_end() -> None:
    leaving = power("sh", "-c", "sleep 40 &", timeout=20.0)

    assert await run_command(leaving, PowerCommand.SHUT_DOWN) == ""


async def test_a_failure_is_logged_with_the_end_of_the_output() -> None:
    command = power("sh", "-c", "yes no | head -c 9000; echo; echo too hot >&2; exit 1")
    with capture_logs() as logs:
        await run_command(command, PowerCommand.SHUT_DOWN)

    (entry,) = (each for each in logs if each["event"] == "power command failed")
    assert entry["setting"] == "power.shutdown_command"
    assert entry["output"].endswith("too hot")
    assert len(entry["output"]) <= OUTPUT_LOGGED


@pytest.mark.parametrize(
    ("commands", "simulated", "offered"),
    [
        ({}, False, frozenset()),
        ({"hibernate_command": ("a",), "wake_command": ("b",)}, False, HIBERNATION),
        ({"shutdown_command": ("a",)}, False, SHUTDOWN),
        ({"hibernate_command": ("a",), "shutdown_command": ("a",)}, False, POWER_ACTIONS),
        ({}, True, POWER_ACTIONS),
    ],
)
def test_the_offered_actions_follow_from_the_commands(
    commands: dict[str, Any],
    *,
    simulated: bool,
    offered: frozenset[str],
) -> None:
    assert PowerSettings(**commands).offered(simulated=simulated) == offered


@pytest.mark.parametrize(
    "wrong", [{"wake_command": ("a",)}, {"shutdown_command": ("",)}, {"command_timeout": 0}]
)
def test_contradictory_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        PowerSettings(**wrong)


@pytest.mark.parametrize("driver", ["loopback", "nav2"])
def test_only_a_loopback_robot_offers_power_actions_without_commands(driver: str) -> None:
    settings = EdgeAgentSettings.model_validate({"driver": driver, "loopback": {"power": True}})

    assert settings.power_actions == (POWER_ACTIONS if driver == "loopback" else frozenset())


@pytest.mark.parametrize(
    ("version", "command", "verdict", "text"),
    [
        ("3.0.1", ("sh",), LinkVerdict.OK, "offers shutdown"),
        ("3.0.0", ("/bin/sh", "-c", "x"), LinkVerdict.OK, "offers shutdown"),
        ("2.1.0", ("sh",), LinkVerdict.DOUBTFUL, "has no hibernation"),
        ("3.0.1", ("/no/such",), LinkVerdict.MISSING, "power.shutdown_command: program /no/such not found"),
        ("3.0.1", ("/etc/passwd",), LinkVerdict.MISSING, "/etc/passwd is not an executable program"),
    ],
)
def test_the_doctor_checks_the_programs(
    version: str, command: tuple[str, ...], verdict: LinkVerdict, text: str
) -> None:
    settings = EdgeAgentSettings.model_validate({"version": version, "power": {"shutdown_command": command}})

    (finding,) = judge_power(settings)

    assert (finding.link, finding.verdict) == (Link.POWER, verdict)
    assert text in finding.text


def test_the_doctor_does_not_mention_a_robot_without_commands() -> None:
    assert judge_power(EdgeAgentSettings()) == []
