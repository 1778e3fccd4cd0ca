"""The demo as a user starts it: it does the job, and leaves nothing behind however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest

from support.waiting import PATIENCE, wait_until

DEMO = str(Path(sys.executable).with_name("nena-demo"))
pytestmark = [pytest.mark.e2e, pytest.mark.ros, pytest.mark.broker, pytest.mark.timeout(420)]


@pytest.fixture
def running_demo(tmp_path: Path, domain_id: int) -> Iterator[subprocess.Popen[str]]:
    """A demo whose services are all started."""
    process = subprocess.Popen(
        [DEMO, "run", "--robots", "3", "--domain-id", str(domain_id)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    assert process.stdout is not None
    for line in process.stdout:
        if "control panel at" in line:
            break
    yield process
    if process.poll() is None:
        process.kill()
        process.wait()


@pytest.mark.long  # make smoke is the first
@pytest.mark.parametrize("broker", ["mosquitto", "amqtt"])
def test_smoke_run_carries_out_an_order_over_rest_and_one_over_mqtt(
    tmp_path: Path, domain_id: int, broker: str
) -> None:
    result = subprocess.run(
        [DEMO, "smoke", "--broker", broker, "--time-factor", "10", "--domain-id", str(domain_id)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )

    assert result.returncode == 0, result.stdout + result.stderr
    assert result.stdout.count("FINISHED") >= 2
    assert "fleet state and metrics are correct" in result.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_signal_ends_every_process_and_removes_every_file(
    running_demo: subprocess.Popen[str], tmp_path: Path, number: signal.Signals
) -> None:
    children = psutil.Process(running_demo.pid).children(recursive=True)
    assert len(children) >= 5

    running_demo.send_signal(number)
    output, _ = running_demo.communicate(timeout=PATIENCE)

    assert running_demo.returncode == 130, output
    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")
    assert list(tmp_path.iterdir()) == []


def test_guided_tour_does_what_each_key_says_and_the_hall_works_on(
    running_demo: subprocess.Popen[str], tmp_path: Path
) -> None:
    lines: list[str] = []

    def read_until(text: str) -> str:
        assert running_demo.stdout
        for line in running_demo.stdout:
            lines.append(line)
            if text in line:
                return line
        raise AssertionError("".join(lines))

    def press(keys: str, text: str) -> str:
        assert running_demo.stdin
        running_demo.stdin.write(keys)
        running_demo.stdin.flush()
        return read_until(text)

    rest = read_until("order service at").split(" at ")[1].strip().removesuffix("/docs")

    def locked() -> int:
        return sum(path["locked"] for path in httpx.get(f"{rest}/v1/paths").json()["paths"])

    read_until("q  stop everything")
    assert not any("OFFLINE" in line or "navigationNotAvailable" in line for line in lines)
    press("b", "blocked:")
    assert locked() == 1
    press("k", "AMR-3 is back")
    stopped = press("e", "emergency stop of").split()[6]
    wait_until(lambda: "mergency" in vehicle(rest, stopped)["reason"], what="the emergency stop shows")
    press("e", "released")
    wait_until(lambda: "mergency" not in vehicle(rest, stopped)["reason"], what="its end shows")
    press("o", "order service stopped")
    with pytest.raises(httpx.ConnectError):
        locked()
    press("o", "order service is started again")
    wait_until(lambda: ready(rest), what="the order service is back")
    assert locked() == 1
    press("b", "open again")
    assert locked() == 0
    robots = len(httpx.get(f"{rest}/v1/vehicles").json()["vehicles"])
    assert f"load peak: {3 * robots} orders" in press("p", "load peak")
    press("r", "#/history")
    while " 0 finished" in read_until(" finished, 0 failed"):
        continue
    children = psutil.Process(running_demo.pid).children(recursive=True)
    press("q", "stopping everything")

    assert running_demo.wait(PATIENCE) == 0
    assert not any("FAILED" in line for line in lines)
    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")
    assert list(tmp_path.iterdir()) == []


def vehicle(rest: str, name: str) -> dict[str, str]:
    status: dict[str, str] = httpx.get(f"{rest}/v1/vehicles/{name}").json()
    return status


def ready(rest: str) -> bool:
    try:
        return httpx.get(f"{rest}/readyz").is_success
    except httpx.HTTPError:
        return False


def test_children_end_when_the_demo_is_killed(running_demo: subprocess.Popen[str]) -> None:
    children = psutil.Process(running_demo.pid).children(recursive=True)
    assert len(children) >= 5

    os.kill(running_demo.pid, signal.SIGKILL)

    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")


def _lives(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
