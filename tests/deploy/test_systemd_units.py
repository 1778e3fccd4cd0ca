"""The systemd units, judged by systemd's own tools, and what the watchdog hears from a real program."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from support.programs import Program
from support.waiting import PATIENCE, until

UNITS = sorted((Path(__file__).parents[2] / "deploy" / "systemd").glob("*.service"))
DROP_IN = UNITS[0].with_name("broker-password.conf")
EXPOSURE = 15
"""Tenths: the most that systemd may count against a unit, of 100."""

pytestmark = pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd is not on this machine")


@pytest.fixture(params=UNITS, ids=[path.stem for path in UNITS])
def unit(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a unit with its drop-in, as installed, but with the programs of this environment."""
    source: Path = request.param
    text = source.read_text().replace("/opt/nena/bin", str(Path(sys.executable).parent))
    copy = tmp_path / source.name
    copy.write_text(text)
    (tmp_path / f"{source.name}.d").mkdir()
    shutil.copy(DROP_IN, tmp_path / f"{source.name}.d")
    return copy


def analyze(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = ["systemd-analyze", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)


def test_units_are_valid(unit: Path) -> None:
    result = analyze("verify", "--man=no", "--recursive-errors=no", unit)

    assert (result.returncode, result.stderr) == (0, "")


def test_units_are_restricted(unit: Path) -> None:
    result = analyze("security", "--offline=true", f"--threshold={EXPOSURE}", unit)

    assert result.returncode == 0, result.stdout


@pytest.fixture
def supervisor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """Listen as systemd does, and pass the address to programs."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.settimeout(0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")
        yield listener


@pytest.mark.e2e
async def test_program_notifies_systemd(supervisor: socket.socket, tmp_path: Path) -> None:
    heard: list[str] = []

    def gather() -> list[str]:
        with suppress(BlockingIOError):
            heard.append(supervisor.recv(200).decode())
        return heard

    settings = ("--driver", "loopback", "--journal.folder", tmp_path / "journal", "--mqtt.port", 9)
    with Program("nena-edge-agent", *settings, log=tmp_path / "log") as program:
        await until(lambda: gather().count("WATCHDOG=1") > 2)
        assert heard[0] == "READY=1"
        program.process.terminate()
        await until(lambda: "STOPPING=1" in gather())
        assert await until(lambda: program.process.poll() is not None)
    assert program.process.returncode == os.EX_OK
