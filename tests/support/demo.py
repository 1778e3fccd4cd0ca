"""The demo in a process of its own, and a person who watches it and presses keys."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from support.waiting import PATIENCE

DEMO = str(Path(sys.executable).with_name("nena-demo"))


@dataclass
class Viewer:
    """A person who watches a demo and presses keys."""

    demo: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)
    panel: str = field(init=False)
    rest: str = field(init=False)
    """URLs of the control panel and the order service."""

    def __post_init__(self) -> None:
        """Read the URLs."""
        self.panel = self.read_until("control panel at").split(" at ")[1].strip()
        self.rest = self.read_until("order service at").split(" at ")[1].strip().removesuffix("/docs")

    def read_until(self, text: str) -> str:
        """Return the next line that contains ``text``."""
        assert self.demo.stdout
        for line in self.demo.stdout:
            self.lines.append(line)
            if text in line:
                return line
        raise AssertionError("".join(self.lines))

    def press(self, key: str, text: str) -> str:
        """Press a key; return the next line that contains ``text``."""
        assert self.demo.stdin
        self.demo.stdin.write(key)
        self.demo.stdin.flush()
        return self.read_until(text)

    def get(self, path: str) -> Any:
        """Return what the order service has at ``path``."""
        return httpx.get(f"{self.rest}/v1/{path}", timeout=PATIENCE).json()

    def locked(self) -> int:
        """Return the number of locked paths."""
        return len(self.get("paths?locked=true")["paths"])

    def is_stopped(self, vehicle: str) -> bool:
        """Return whether a vehicle reports an emergency stop."""
        return "mergency" in self.get(f"vehicles/{vehicle}")["reason"]

    def service_is_ready(self) -> bool:
        """Return whether the order service answers and is ready."""
        try:
            return httpx.get(f"{self.rest}/readyz", timeout=PATIENCE).is_success
        except httpx.HTTPError:
            return False


@contextmanager
def started(folder: Path, domain_id: int, *, robots: int) -> Iterator[Viewer]:
    """Start a demo that keeps its files in ``folder``; its services run when the context is entered."""
    process = subprocess.Popen(
        [DEMO, "run", "--robots", str(robots), "--domain-id", str(domain_id)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(folder)},
    )
    try:
        yield Viewer(process)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
