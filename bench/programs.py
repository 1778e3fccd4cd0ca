"""The measured programs of one or two versions of NeNa, run as processes on the loopback interface."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from statistics import quantiles

import httpx
import psutil

from nena_demo.processes import MOSQUITTO_CONFIGURATION, free_port, mosquitto_path
from nena_shared.plant import PlantModel
from support.waiting import wait_until

WAIT_SECONDS = 300.0
STOP_SECONDS = 20.0
LOOK_EVERY = 0.2

Figures = dict[str, float]
"""What was measured: name with its unit, and value. Smaller is better unless the name says ``per_``."""


@dataclass(frozen=True)
class Version:
    """A checkout of NeNa with its ``.venv``."""

    name: str
    root: Path

    def program(self, name: str) -> str:
        """Return the path of a console script."""
        return str(self.root / ".venv/bin" / name)


@dataclass
class Site:
    """A broker, and programs of one version beside it."""

    version: Version
    folder: Path
    broker_port: int
    processes: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def start(self, name: str, *command: str, environment: Mapping[str, str] | None = None) -> int:
        """Start a program; return its process ID. Its output goes to ``NAME.log``."""
        with (self.folder / f"{name}.log").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **self._environment(), **(environment or {})},
                start_new_session=True,
            )
        return self.processes[name].pid

    def start_order_service(self, plant: PlantModel) -> str:
        """Start the order service on a plant; return its URL when it is ready."""
        file, port = self.folder / "plant.json", free_port()
        file.write_text(plant.to_json(), encoding="utf-8")
        self.start(
            "order-service",
            self.version.program("nena-order-service"),
            *("--plant", str(file), "--store.url", f"sqlite:///{self.folder / 'orders.db'}"),
            *("--http.port", str(port), "--http.burst", "1000000"),
        )
        return self._ready(port)

    def start_aggregator(self, order_service: str) -> str:
        """Start the status aggregator; return its URL when it is ready."""
        port = free_port()
        self.start(
            "status-aggregator",
            self.version.program("nena-status-aggregator"),
            *("--http.port", str(port), "--order_service.url", order_service),
            *("--history.url", f"sqlite:///{self.folder / 'history.db'}"),
        )
        return self._ready(port)

    def stop(self, name: str) -> None:
        """End a program by SIGTERM, or by SIGKILL if that does not end it."""
        process = self.processes.pop(name)
        process.terminate()
        try:
            process.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def cpu(self) -> dict[str, float]:
        """Return the CPU time of each program, s."""
        return {name: cpu_of(process.pid) for name, process in self.processes.items()}

    def memory(self) -> dict[str, float]:
        """Return the resident memory of each program, MB."""
        return {name: memory_of(process.pid) for name, process in self.processes.items()}

    def _environment(self) -> dict[str, str]:
        return {
            "NENA_MQTT__HOST": "127.0.0.1",
            "NENA_MQTT__PORT": str(self.broker_port),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(self.folder / "ros"),
        }

    def _ready(self, port: int) -> str:
        url = f"http://127.0.0.1:{port}"

        def ready() -> bool:
            with suppress(httpx.TransportError):
                return httpx.get(f"{url}/readyz").status_code == httpx.codes.OK
            return False

        wait_until(ready, timeout=WAIT_SECONDS, what=f"{url} is ready", every=LOOK_EVERY)
        return url


@contextmanager
def running_site(version: Version) -> Iterator[Site]:
    """Start a broker; end it and all programs with the block."""
    mosquitto, port = mosquitto_path(), free_port()
    if mosquitto is None:
        raise SystemExit("mosquitto is not installed: run `make broker`")
    with tempfile.TemporaryDirectory(prefix="nena-bench-") as name:
        site = Site(version, Path(name), port)
        configuration = site.folder / "mosquitto.conf"
        user = psutil.Process().username()
        configuration.write_text(MOSQUITTO_CONFIGURATION.format(port=port, user=user), encoding="utf-8")
        site.start("broker", mosquitto, "-c", str(configuration))
        try:
            wait_until(lambda: _is_open(port), timeout=WAIT_SECONDS, what="the broker is there")
            yield site
        finally:
            for each in reversed(list(site.processes)):
                site.stop(each)


def _is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def yardstick(module: str, *arguments: str) -> Iterator[int]:
    """Run a module of the benchmark as a process until the block ends; yield its ID when it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-m", module, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    try:
        if process.stdout.readline() != "ready\n":
            message = f"{module} did not start"
            raise RuntimeError(message)
        yield process.pid
    finally:
        process.communicate(timeout=STOP_SECONDS)


def wait_for_end_of_input() -> None:
    """Report that a yardstick is ready, then wait for its input to end."""
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.read()


def cpu_of(pid: int) -> float:
    """Return the CPU time of a process, s."""
    times = psutil.Process(pid).cpu_times()
    return float(times.user + times.system)


def memory_of(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    return float(psutil.Process(pid).memory_info().rss / 1e6)


def percentiles(name: str, samples: list[float]) -> Figures:
    """Return the median and the 99th percentile of samples (s) in ms."""
    hundredths = quantiles(samples, n=100, method="inclusive")
    return {f"{name}_p50_ms": hundredths[49] * 1e3, f"{name}_p99_ms": hundredths[98] * 1e3}


class Pace:
    """Runs at ``rate`` per second; delays are caught up."""

    def __init__(self, rate: float) -> None:
        self._start = time.perf_counter()
        self._rate = rate

    def seconds_until(self, count: int) -> float:
        """Return how long it is until the one of this number is due, from 0 on."""
        return max(0.0, self._start + count / self._rate - time.perf_counter())
