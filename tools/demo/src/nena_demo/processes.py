"""Child processes of the demo, each with a log file and ended in any case, and the MQTT broker."""

from __future__ import annotations

import asyncio
import getpass
import math
import os
import secrets
import shutil
import signal
import socket
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

STOP_SECONDS = 8.0
"""Time for a child to end before it is killed, seconds."""

TAIL_LINES = 12

LOOK_EVERY = 0.5
"""Interval between two looks at all children, seconds."""

SOON_SECONDS = 10.0
"""A child that ends within this time of its start, seconds, is not fit to run."""

QUICK_ENDS = 3
"""Number of such ends in a row after which it is given up."""


class ChildFailedError(Exception):
    """A child process ended or did not become ready; the text contains the end of its log."""

    def __init__(self, name: str, what: str, log_tail: str) -> None:
        super().__init__(f"{name} {what}; end of its log:\n{log_tail}")
        self.name = name


@dataclass
class Child:
    """A running process."""

    name: str
    process: asyncio.subprocess.Process
    log: Path
    command: Sequence[str] = ()
    environment: Mapping[str, str] | None = None
    wanted: bool = True
    """Whether it is to be started again if it ends."""
    quick_ends: int = 0
    """How often in a row it has ended soon after its start."""
    started: float = field(default_factory=time.monotonic)

    def tail(self) -> str:
        """Return the last lines of its log."""
        text = self.log.read_text(encoding="utf-8", errors="replace") if self.log.exists() else ""
        return "\n".join("    " + line for line in text.splitlines()[-TAIL_LINES:])

    def check(self) -> None:
        """Raise ChildFailedError if it has ended."""
        if self.process.returncode is not None:
            raise ChildFailedError(self.name, f"ended with status {self.process.returncode}", self.tail())


@dataclass
class Processes:
    """All child processes; leaving the context ends them, the newest first."""

    folder: Path
    children: list[Child] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Create the folder for logs and files."""
        self.folder.mkdir(parents=True, exist_ok=True)

    async def __aenter__(self) -> Self:
        """Return the empty set of processes."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End every child: by SIGTERM, then by SIGKILL."""
        for child in reversed(self.children):
            await self._stop_child(child)

    async def start(
        self, name: str, command: Sequence[str], *, environment: Mapping[str, str] | None = None
    ) -> Child:
        """Start ``command``; its output goes to a log file with its name."""
        log = self.folder / f"{name}.log"
        log.unlink(missing_ok=True)
        child = Child(name, await _spawn_process(command, environment, log), log, command, environment)
        self.children.append(child)
        return child

    async def restart(self, child: Child) -> None:
        """Start a child that has ended again; its output is appended to its log."""
        child.process = await _spawn_process(child.command, child.environment, child.log)
        child.wanted, child.started = True, time.monotonic()

    async def stop(self, child: Child) -> None:
        """End a child, which :meth:`keep_running` then leaves alone."""
        child.wanted = False
        await self._stop_child(child)

    async def kill(self, child: Child) -> None:
        """Kill a child, which :meth:`keep_running` starts again; however often, that is no failure."""
        if child.process.returncode is None:
            child.started = -math.inf
            child.process.kill()
            await child.process.wait()

    async def keep_running(self, tell: Callable[[str], None]) -> None:
        """Start every child again that ends, and ``tell`` of it, until cancelled.

        Raises:
            ChildFailedError: a child ends again and again, each time soon after its start.
        """
        while True:
            for child in self.children:
                if child.wanted and child.process.returncode is not None:
                    await self._bring_back(child, tell)
            await asyncio.sleep(LOOK_EVERY)

    async def _bring_back(self, child: Child, tell: Callable[[str], None]) -> None:
        soon = time.monotonic() - child.started < SOON_SECONDS
        child.quick_ends = child.quick_ends + 1 if soon else 0
        if child.quick_ends > QUICK_ENDS:
            child.check()
        tell(f"{child.name} {_how_it_ended(child.process.returncode)}; it is started again")
        await self.restart(child)

    def check(self) -> None:
        """Raise ChildFailedError if any child has ended: the first one."""
        for child in self.children:
            child.check()

    async def _stop_child(self, child: Child) -> None:
        if child.process.returncode is not None:
            return
        child.process.send_signal(signal.SIGTERM)
        try:
            async with asyncio.timeout(STOP_SECONDS):
                await child.process.wait()
        except TimeoutError:
            child.process.kill()
            await child.process.wait()


async def _spawn_process(
    command: Sequence[str], environment: Mapping[str, str] | None, log: Path
) -> asyncio.subprocess.Process:
    with log.open("ab") as output:
        return await asyncio.create_subprocess_exec(
            *_dies_with_us(),
            *command,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=output,
            stderr=asyncio.subprocess.STDOUT,
            env={**os.environ, **(environment or {})},
            start_new_session=True,  # Ctrl-C reaches only the demo, which then ends its children in order
        )


def _how_it_ended(status: int | None) -> str:
    return "was killed" if status == -signal.SIGKILL else f"has ended with status {status}"


def console_script(name: str) -> str:
    """Return the path of a console script of this environment."""
    return str(Path(sys.executable).with_name(name))


def _dies_with_us() -> list[str]:
    """Return a command prefix that ends the child with the demo, if setpriv is installed."""
    setpriv = shutil.which("setpriv")
    return [setpriv, "--pdeathsig", "TERM"] if setpriv else []


PORTS = range(15_000, 32_000)
"""Ports that the system does not give to a robot's connection between their choice and their use."""


def free_port() -> int:
    """Return an unused TCP port of 127.0.0.1."""
    while True:
        port = secrets.choice(PORTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


START_SECONDS = 15.0

MOSQUITTO_CONFIGURATION = """\
listener {port} 127.0.0.1
allow_anonymous true
# a change of user would prevent it from ending with the demo
user {user}
persistence false
# without it, small messages may be delayed by 44 ms
set_tcp_nodelay true
# a slow client loses the oldest messages instead of filling the memory
max_queued_messages 10000
max_inflight_messages 200
max_packet_size 67108864
log_type error
log_type warning
log_type notice
"""

AMQTT_CONFIGURATION = """\
listeners:
  default:
    type: tcp
    bind: 127.0.0.1:{port}
plugins:
  amqtt.plugins.authentication.AnonymousAuthPlugin:
    allow_anonymous: true
"""

AMQTT_NOTICE = (
    "Mosquitto is not installed: the demo uses amqtt, a broker in Python. It detects a dead robot only "
    "when its socket closes, and keeps no sessions. Recommended: apt-get install mosquitto"
)


def mosquitto_path() -> str | None:
    """Find Mosquitto, including in /usr/sbin, which is not on every user's PATH."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


async def start_broker(processes: Processes, port: int, kind: str) -> Child:
    """Start a broker on the loopback interface and wait until it accepts connections.

    ``kind`` is ``auto``, ``mosquitto`` or ``amqtt``.

    Raises:
        ChildFailedError: it did not start.
    """
    mosquitto = mosquitto_path() if kind in ("auto", "mosquitto") else None
    if mosquitto:
        command = [
            mosquitto,
            "-c",
            str(_write_configuration(processes.folder / "mosquitto.conf", MOSQUITTO_CONFIGURATION, port)),
        ]
    else:
        configuration = _write_configuration(processes.folder / "amqtt.yaml", AMQTT_CONFIGURATION, port)
        command = [console_script("amqtt"), "-c", str(configuration)]
    child = await processes.start("broker", command)
    await _wait_for_port(child, port)
    return child


def _write_configuration(path: Path, template: str, port: int) -> Path:
    path.write_text(template.format(port=port, user=getpass.getuser()), encoding="utf-8")
    return path


async def _wait_for_port(child: Child, port: int) -> None:
    async with asyncio.timeout(START_SECONDS):
        while True:
            child.check()
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", port)
            except OSError:
                await asyncio.sleep(0.05)
            else:
                writer.close()
                await writer.wait_closed()
                return
