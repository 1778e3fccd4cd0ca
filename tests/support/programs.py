"""Programs of this project as processes of their own, for tests that kill them or measure them."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Self

import httpx
import psutil

from support.waiting import PATIENCE, STARTUP, until

ENDED_WITHIN = PATIENCE
"""Seconds that a program has to end in order."""
LOG_SHOWN = 3000
"""Last characters of a log that an error shows."""


SURVIVED = (
    "task restarts after a failure",
    "message handler failed",
    "reading a postponed message failed",
    "effect of a committed change failed",
    "unit of work failed",
    "a committed change was not published",
    "event not handled",
    "a step failed",
)
"""Log events of failures after which a service continues; the first line of each."""


def as_from_a_terminal() -> None:
    """Let programs that tests start end at SIGINT, and keep what Python compiles of them.

    A shell without job control has commands behind ``&`` ignore SIGINT, and programs inherit that. Modules
    that are compiled at each start take more of the CPU than the start itself.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)


def what_of(process: subprocess.Popen[bytes]) -> str:
    """Return the exit status of a program; if it runs, its state and CPU time: does it hang or lack CPU?"""
    if process.poll() is not None:
        return f"exit status {process.returncode}"
    running = psutil.Process(process.pid)
    return (
        f"runs: {running.status()}, {running.num_threads()} threads, CPU {sum(running.cpu_times()[:2]):.1f} s"
    )


def require_no_failures(log: str) -> None:
    """Fail if a service has survived a failure, which only its log tells."""
    assert not (found := [line for line in log.splitlines() if any(event in line for event in SURVIVED)]), (
        found
    )


class Program:
    """A console script of the virtual environment; its log goes into a file.

    ``before`` is a command that runs it elsewhere (another network) in the same process.
    """

    def __init__(
        self,
        script: str,
        *arguments: object,
        log: Path,
        before: Sequence[str] = (),
        environment: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        self.log_file = log
        command = [*before, str(Path(sys.executable).with_name(script)), *map(str, arguments)]
        with log.open("ab") as out:
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                env={**_environment(), **environment},
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(ENDED_WITHIN)
        except subprocess.TimeoutExpired:
            state = what_of(self.process)
            self.kill()
            assert kind is not None, f"did not end at SIGINT; {state}; its log:\n{self.log[-LOG_SHOWN:]}"
        if kind is None:
            require_no_failures(self.log)

    @property
    def log(self) -> str:
        """What the program has written."""
        return self.log_file.read_text(encoding="utf-8")

    @property
    def memory_mb(self) -> float:
        """Resident memory in MB."""
        return float(psutil.Process(self.process.pid).memory_info().rss) / 1e6

    def kill(self) -> None:
        """End it as a power cut would."""
        self.process.kill()
        self.process.wait()

    async def logged(self, pattern: str, *, start: int = 0) -> re.Match[str]:
        """Return the first match of ``pattern`` in the log behind ``start``; fails when the program ends."""

        def found() -> re.Match[str] | None:
            match = re.search(pattern, self.log[start:])
            assert match or self.process.poll() is None, f"the program has ended:\n{self.log}"
            return match

        return await until(
            found,
            timeout=STARTUP,
            what=lambda: f"{pattern} in the log of {self.process.args!r}, which {what_of(self.process)}",
        )


class OrderServiceProgram(Program):
    """The order service on a free port."""

    def __init__(
        self, *arguments: object, log: Path, environment: Mapping[str, str] = MappingProxyType({})
    ) -> None:
        self._start = len(log.read_text(encoding="utf-8")) if log.exists() else 0
        super().__init__("nena-order-service", "--http.port", 0, *arguments, log=log, environment=environment)

    async def client(self) -> httpx.AsyncClient:
        """Return a client once the program listens."""
        url = (await self.logged(r"http listening.* url=(\S+)", start=self._start)).group(1)
        return httpx.AsyncClient(base_url=url, timeout=PATIENCE, transport=_Explaining(self))


class _Explaining(httpx.AsyncHTTPTransport):
    """Add what a program has logged last to the errors of connections that it did not answer."""

    def __init__(self, program: Program) -> None:
        super().__init__()
        self._program = program

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        try:
            return await super().handle_async_request(request)
        except httpx.TransportError as error:
            error.add_note(
                f"exit code: {self._program.process.poll()}; its log:\n{self._program.log[-LOG_SHOWN:]}"
            )
            raise


def _environment() -> dict[str, str]:
    """Pass on nothing that would set a setting of a program."""
    return {name: value for name, value in os.environ.items() if not name.startswith("NENA_")}
