"""A real Prometheus with the project's own configuration."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Awaitable, Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Self, TypeVar

import httpx
import pytest

from nena_shared.vda5050.topics import RobotKey
from support.broker import free_port
from support.reference import PROJECT
from support.waiting import PATIENCE, awaited

CONFIGURATION = PROJECT / "deploy" / "prometheus"
GRAFANA = PROJECT / "deploy" / "grafana"
DASHBOARDS = sorted((GRAFANA / "dashboards").glob("*.json"))

T = TypeVar("T")

END_WITHIN = PATIENCE
"""Seconds."""

LOOK_EVERY = 0.05
"""Seconds."""

LONGEST_FOR = 8
"""Seconds; above the 7 s after which an order service without heartbeats counts as down."""
UNITS = {"s": 1, "m": 60, "h": 3600}
DURATION = re.compile(r"(?P<before>\bfor: |\[|\boffset )(?P<number>\d+)(?P<unit>[smh])")
UNHURRIED = "NenaProgramSlow"
"""Its metric covers the last minute: a shorter `for` finds single hiccups, so only its own test uses one."""


async def eventually(ask: Callable[[], Awaitable[T]], what: str) -> T:
    """Repeat a call until its result is true, and return it."""
    return await awaited(ask, bool, what=what, every=LOOK_EVERY)


def program(name: str) -> str:
    """Return the path of `prometheus`, `promtool` or `prometheus-alertmanager`; skip the test without it."""
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"{name} is not there: make monitoring")
    return path


def hurried(rules: str, unhurried: str = UNHURRIED) -> str:
    """Return rules that find a fault within seconds, with the same expressions.

    ``for`` is at most :data:`LONGEST_FOR`, and windows have a second for each minute, so that alerts also end
    within seconds. As before, no window is longer than the ``for`` of a rule that relies on that.
    """
    groups = re.split(r"(?m)^(?=      - (?:alert|record): )", rules)
    kept = f"alert: {unhurried}\n"
    return "".join(each if kept in each else DURATION.sub(_hurry, each) for each in groups)


def _hurry(found: re.Match[str]) -> str:
    seconds = int(found["number"]) * UNITS[found["unit"]]
    shorter = min(seconds, LONGEST_FOR) if found["before"] == "for: " else max(1, seconds // 60)
    return f"{found['before']}{shorter}s"


def dashboard_queries(robot: RobotKey) -> Iterator[tuple[str, str]]:
    """Yield all queries of the dashboards with their panels, with variables filled in."""
    variables = {"$manufacturer": robot.manufacturer, "$serial": robot.serial_number, "$instance": ".+"}

    def filled(expression: str) -> str:
        for name, value in variables.items():
            expression = expression.replace(name, value)
        return expression

    for file in DASHBOARDS:
        board = json.loads(file.read_text(encoding="utf-8"))
        for variable in board["templating"]["list"]:
            wanted = re.fullmatch(r"label_values\((.+), \w+\)", variable["query"]["query"])
            assert wanted, variable
            yield f"{board['title']}: {variable['name']}", filled(wanted[1])
        for panel in board["panels"]:
            for target in panel["targets"]:
                yield f"{board['title']}: {panel['title']}", filled(target["expr"])


class Prometheus:
    """A Prometheus that scrapes and evaluates every second."""

    def __init__(
        self,
        folder: Path,
        *aggregators: str,
        order_services: Sequence[str] = (),
        agents: Sequence[str] = (),
        alertmanager: str = "",
        unhurried: str = UNHURRIED,
    ) -> None:
        """Start with these targets (host and port), and its files in ``folder``.

        With an ``alertmanager`` the rules are :func:`hurried`, except that of ``unhurried``.
        """
        text = (CONFIGURATION / "prometheus.yml").read_text(encoding="utf-8").replace("15s", "1s")
        text = text.replace('"127.0.0.1:8080"', _listed(aggregators))
        text = text.replace('"127.0.0.1:55200"', _listed(order_services))
        rules = CONFIGURATION / "rules"
        if agents:
            text = _uncommented(text, "- job_name: nena-edge-agent", agents)
        if alertmanager:
            text = _uncommented(text, "alertmanagers:", (alertmanager,))
            rules = _hurried_rules(folder, unhurried)
        text = text.replace("rules/*.yml", f"{rules}/*.yml")
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


def _listed(targets: Sequence[str]) -> str:
    return ", ".join(f'"{each}"' for each in targets)


def _uncommented(text: str, first: str, targets: Sequence[str]) -> str:
    """Return the configuration with the block that begins with ``first``, with these targets."""
    before, block, rest = re.split(rf"(?ms)^( *# {re.escape(first)}$.*?targets: \[).*?\]", text)
    block = re.sub(r"(?m)^( *)# ", r"\1", block)
    return f"{before}{block}{_listed(targets)}]{rest}"


def _hurried_rules(folder: Path, unhurried: str) -> Path:
    made = folder / "rules"
    made.mkdir()
    for file in (CONFIGURATION / "rules").glob("*.yml"):
        (made / file.name).write_text(hurried(file.read_text(encoding="utf-8"), unhurried), encoding="utf-8")
    return made
