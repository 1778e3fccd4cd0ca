"""The demo as a user starts it: it does the job, and leaves nothing behind however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from support.waiting import PATIENCE, wait_until

DEMO = str(Path(sys.executable).with_name("nena-demo"))
pytestmark = [pytest.mark.e2e, pytest.mark.ros, pytest.mark.broker, pytest.mark.timeout(420)]


@pytest.fixture
def running_demo(tmp_path: Path, domain_id: int) -> Iterator[subprocess.Popen[str]]:
    """A demo whose services are all started."""
    process = subprocess.Popen(
        [DEMO, "run", "--time-factor", "10", "--domain-id", str(domain_id)],
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


def test_children_end_when_the_demo_is_killed(running_demo: subprocess.Popen[str]) -> None:
    children = psutil.Process(running_demo.pid).children(recursive=True)
    assert len(children) >= 5

    os.kill(running_demo.pid, signal.SIGKILL)

    wait_until(lambda: not any(_lives(child) for child in children), what="end of all children")


def _lives(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
