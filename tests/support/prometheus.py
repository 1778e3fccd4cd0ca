"""A real Prometheus with the project's own configuration."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Self, TypeVar

import httpx
import pytest

from support.broker import free_port
from support.reference import PROJECT
from support.waiting import PATIENCE, awaited

CONFIGURATION = PROJECT / "deploy" / "prometheus"

T = TypeVar("T")

END_WITHIN = PATIENCE
"""Seconds."""

LOOK_EVERY = 0.05
"""Seconds."""


async def eventually(ask: Callable[[], Awaitable[T]], what: str) -> T:
    """Repeat a call until its result is true, and return it."""
    return await awaited(ask, bool, what=what, every=LOOK_EVERY)


def program(name: str) -> str:
    """Return the path of `prometheus` or `promtool`; skip the test if it is not installed."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not there: apt-get install prometheus")
    return path


class Prometheus:
    """A Prometheus that scrapes and evaluates every second."""

    def __init__(self, folder: Path, *aggregators: str, order_service: str = "") -> None:
        """Start with these aggregators (host and port) as targets, and its files in ``folder``."""
        text = (CONFIGURATION / "prometheus.yml").read_text(encoding="utf-8")
        text = text.replace('"127.0.0.1:8080"', ", ".join(f'"{each}"' for each in aggregators)).replace(
            "15s", "1s"
        )
        text = text.replace('"127.0.0.1:55200"', f'"{order_service}"' if order_service else "")
        text = text.replace("rules/*.yml", f"{CONFIGURATION}/rules/*.yml")
        (folder / "prometheus.yml").write_text(text, encoding="utf-8")
        port = free_port()
        self.http = httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}/api/v1", timeout=PATIENCE)
        self._log = folder / "log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [
                    program("prometheus"),
                    f"--config.file={folder / 'prometheus.yml'}",
                    f"--storage.tsdb.path={folder / 'data'}",
                    f"--web.listen-address=127.0.0.1:{port}",
                ],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    async def __aenter__(self) -> Self:
        await eventually(self._answers, "Prometheus")
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.http.aclose()
        self._process.terminate()
        self._process.wait(END_WITHIN)

    async def query(self, expression: str) -> list[dict[str, Any]]:
        """Return the samples of an instant query; an invalid one fails the test."""
        answer = (await self.http.get("/query", params={"query": expression})).json()
        assert answer["status"] == "success", f"{expression}: {answer}"
        found: list[dict[str, Any]] = answer["data"]["result"]
        return found

    async def rules(self) -> list[dict[str, Any]]:
        """Return all rules with their state."""
        groups = (await self.http.get("/rules")).json()["data"]["groups"]
        return [rule for group in groups for rule in group["rules"]]

    async def _answers(self) -> bool:
        assert self._process.poll() is None, self._log.read_text(encoding="utf-8")
        try:
            return (await self.http.get("/status/buildinfo")).status_code == httpx.codes.OK
        except httpx.TransportError:
            return False
