"""The status aggregator in a separate process."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from support.programs import require_no_failures, what_of
from support.waiting import PATIENCE, STARTUP, until

END_WITHIN = PATIENCE
"""Seconds."""


class AggregatorProcess:
    """The process of ``nena-status-aggregator``; its log is read as JSON lines."""

    def __init__(self, *options: str) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="nena-test-aggregator-")
        self._stderr = Path(self._folder.name) / "stderr"
        command = [sys.executable, "-m", "nena_status_aggregator", "--log.form", "json", *options]
        with self._stderr.open("wb") as stderr:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stderr=stderr, cwd=self._folder.name
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(END_WITHIN)
        log = self.output
        self._folder.cleanup()
        if kind is None:
            require_no_failures(log)

    @property
    def output(self) -> str:
        """Its standard error so far."""
        return self._stderr.read_text(encoding="utf-8")

    def events(self, event: str) -> list[dict[str, Any]]:
        """Return the log lines of one event."""
        lines = [line for line in self.output.splitlines() if line.startswith("{") and line.endswith("}")]
        return [line for line in map(json.loads, lines) if line["event"] == event]

    async def logged(self, event: str) -> dict[str, Any]:
        """Wait for the first log line of one event."""
        found = await until(
            lambda: self.events(event),
            timeout=STARTUP,
            what=lambda: f"log event '{event}' ({what_of(self.process)}): {self.output}",
        )
        return found[0]

    async def url(self) -> str:
        """Wait until it answers requests, and return its URL."""
        return str((await self.logged("http listening"))["url"])

    def end(self) -> int:
        """Stop it, and return its exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(END_WITHIN)
