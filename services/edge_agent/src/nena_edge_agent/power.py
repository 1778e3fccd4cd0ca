"""The configured commands that hibernate, wake and shut down the robot."""

from __future__ import annotations

import asyncio
import os
import shutil
import signal
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Annotated, Self

from pydantic import Field, model_validator

from nena_edge_agent.protocol.declaration import HIBERNATION, POWER_ACTIONS
from nena_edge_agent.protocol.events import PowerCommand
from nena_shared.log import get_logger
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.action import SHUTDOWN

log = get_logger(__name__)

WAKE_UP_VARIABLE = "NENA_WAKE_UP_TIME"
"""Environment variable of the hibernate command: its wakeUpTime."""
OUTPUT_LOGGED = 4000
"""Maximum bytes of a failed command's output that are logged, from its end."""
KILL_TIMEOUT = 5.0
"""Timeout for a killed command to end, seconds; a command of another user, or one that waits for a device,
may not end."""

Command = tuple[Annotated[str, Field(min_length=1, max_length=4096)], ...]


class PowerSettings(SettingsGroup):
    """Commands that hibernate, wake and shut down the robot (VDA 5050 3.0): program and arguments."""

    hibernate_command: Command = Field(
        (),
        description="Command that puts the robot into its low-power mode, as a list: "
        '["systemctl", "start", "robot-sleep.service"]. The agent and its network must keep running. '
        "Unset: the robot does not offer hibernation.",
    )
    wake_command: Command = Field(
        (), description="Command that ends the low-power mode. Unset: none is needed."
    )
    shutdown_command: Command = Field(
        (), description="Command that shuts the robot down. Unset: the robot does not offer shutdown."
    )
    command_timeout: float = Field(
        60.0, gt=0, le=3600, allow_inf_nan=False, description="Timeout of each command, seconds."
    )

    @model_validator(mode="after")
    def _in_pairs(self) -> Self:
        if self.wake_command and not self.hibernate_command:
            raise ValueError("wake_command needs a hibernate_command")
        return self

    def offered(self, *, simulated: bool) -> frozenset[str]:
        """Return the actions that the robot offers; ``simulated``: all of them, even without commands."""
        if simulated:
            return POWER_ACTIONS
        sleeps = HIBERNATION if self.hibernate_command else frozenset()
        return sleeps | (frozenset({SHUTDOWN}) if self.shutdown_command else frozenset())

    def command(self, kind: PowerCommand) -> Command:
        """Return the command of this kind; empty if none is set."""
        command: Command = getattr(self, kind.value)
        return command

    def problems(self) -> dict[PowerCommand, str]:
        """Return the problems of the commands, by setting: programs that cannot be run."""
        problems: dict[PowerCommand, str] = {}
        for kind in PowerCommand:
            program = next(iter(self.command(kind)), None)
            if program and not shutil.which(program):
                exists = Path(program).exists()
                problems[kind] = (
                    f"{program} is not an executable program" if exists else f"program {program} not found"
                )
        return problems


async def run_command(
    settings: PowerSettings, kind: PowerCommand, environment: Mapping[str, str] | None = None
) -> str:
    """Run the command of this kind, if one is set; return its failure, empty on success.

    If it fails, its output is logged. It is killed after the timeout, and if the task is cancelled. A robot
    must always wake: a command that cannot be killed is abandoned, and a full disk only costs the output.
    """
    command = settings.command(kind)
    if not command:
        return ""
    with _output_file() as output:
        problem = await _run_process(settings, command, output, {**os.environ, **(environment or {})})
        if problem:
            log.warning(
                "power command failed", setting=f"power.{kind}", problem=problem, output=_output_tail(output)
            )
        else:
            log.info("power command ended", setting=f"power.{kind}")
    return problem


def _output_file() -> AbstractContextManager[IO[bytes] | None]:
    """Return a file for the output of a command, None if the disk is full."""
    try:
        # Not a pipe: a child process that continues would keep it open, and the command would not end.
        return TemporaryFile()
    except OSError as error:
        log.warning("the output of a power command is lost", problem=str(error))
        return nullcontext()


async def _run_process(
    settings: PowerSettings, command: Command, output: IO[bytes] | None, environment: Mapping[str, str]
) -> str:
    written = asyncio.subprocess.DEVNULL if output is None else output
    try:
        process = await asyncio.create_subprocess_exec(
            *command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=written,
            stderr=written,
            env=environment,
            # Its own process group, so that a killed command leaves no children.
            start_new_session=True,
        )
    except OSError as error:
        return f"{command[0]} cannot be started: {error.strerror}"
    try:
        async with asyncio.timeout(settings.command_timeout):
            code = await process.wait()
    except TimeoutError:
        problem = f"{command[0]} did not end within {settings.command_timeout:g} s"
        return problem if await _kill_group(process) else f"{problem} and cannot be killed"
    # 0048: after a killed hibernate_command, the robot says HIBERNATING and may be awake, which is safe.
    except asyncio.CancelledError:
        await _kill_group(process)
        raise
    if code < 0:
        return f"{command[0]} was ended by signal {-code}"
    return f"{command[0]} ended with exit code {code}" if code else ""


async def _kill_group(process: asyncio.subprocess.Process) -> bool:
    """Kill a command and all its child processes; return whether it has ended."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)
    with suppress(TimeoutError):
        async with asyncio.timeout(KILL_TIMEOUT):
            await process.wait()
    return process.returncode is not None


def _output_tail(output: IO[bytes] | None) -> str:
    """Return the end of a command's output."""
    if output is None:
        return ""
    size = output.seek(0, os.SEEK_END)
    output.seek(max(0, size - OUTPUT_LOGGED))
    return output.read().decode(errors="replace").strip()
