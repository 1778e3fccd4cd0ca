"""The demo as a user starts it: it does the job, and leaves nothing behind however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest

from support.demo import DEMO, Viewer, started
from support.waiting import PATIENCE, wait_until

pytestmark = [pytest.mark.e2e, pytest.mark.ros, pytest.mark.broker, pytest.mark.timeout(420)]


@pytest.fixture
def viewer(tmp_path: Path, domain_id: int) -> Iterator[Viewer]:
    """A demo whose services are all started, and its viewer."""
    with started(tmp_path, domain_id, robots=3) as viewer:
        yield viewer


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
    viewer: Viewer, tmp_path: Path, number: signal.Signals
) -> None:
    children = psutil.Process(viewer.demo.pid).children(recursive=True)
    assert len(children) >= 5

    viewer.demo.send_signal(number)
    output, _ = viewer.demo.communicate(timeout=PATIENCE)

    assert viewer.demo.returncode == 130, output
    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")
    assert list(tmp_path.iterdir()) == []


def test_guided_tour_does_what_each_key_says_and_the_hall_works_on(viewer: Viewer, tmp_path: Path) -> None:
    viewer.read_until("q  stop everything")
    assert not any("OFFLINE" in line or "navigationNotAvailable" in line for line in viewer.lines)
    viewer.press("b", "blocked:")
    assert viewer.locked() == 1
    viewer.press("k", "AMR-3 is back")
    stopped = viewer.press("e", "emergency stop of").split()[6]
    wait_until(lambda: viewer.is_stopped(stopped), what="the emergency stop shows")
    viewer.press("e", "released")
    wait_until(lambda: not viewer.is_stopped(stopped), what="its end shows")
    viewer.press("o", "order service stopped")
    with pytest.raises(httpx.ConnectError):
        viewer.locked()
    viewer.press("o", "order service is started again")
    wait_until(viewer.service_is_ready, what="the order service is back")
    assert viewer.locked() == 1
    viewer.press("b", "open again")
    assert viewer.locked() == 0
    robots = len(viewer.get("vehicles")["vehicles"])
    assert f"load peak: {3 * robots} orders" in viewer.press("p", "load peak")
    viewer.press("r", "#/history")
    while " 0 finished" in viewer.read_until(" finished, 0 failed"):
        continue
    children = psutil.Process(viewer.demo.pid).children(recursive=True)
    viewer.press("q", "stopping everything")

    assert viewer.demo.wait(PATIENCE) == 0
    assert not any("FAILED" in line for line in viewer.lines)
    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")
    assert list(tmp_path.iterdir()) == []


def test_children_end_when_the_demo_is_killed(viewer: Viewer) -> None:
    children = psutil.Process(viewer.demo.pid).children(recursive=True)
    assert len(children) >= 5

    os.kill(viewer.demo.pid, signal.SIGKILL)

    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")


def _lives(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:  # it ended between the two questions
        return False
