"""How a program ends: in this process, and as a process that gets signals."""

from __future__ import annotations

import asyncio
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from nena_shared.program import (
    EXIT_FAILED,
    EXIT_MISCONFIGURED,
    HEARTBEAT_FILE,
    Supervision,
    heartbeats,
    run,
)
from nena_shared.settings import ConfigurationError, ServiceSettings
from nena_shared.tasks import StartError, Supervisor
from support.pausing import time_passes
from support.waiting import PATIENCE, until

PROGRAM = """
import asyncio, sys
from nena_shared.program import run
from nena_shared.settings import ServiceSettings

async def serve(settings, stop):
    print("ready", flush=True)
    await stop.wait()
    print("in order", flush=True)

sys.exit(run(ServiceSettings, serve, program="example", description="Waits."))
"""


async def end_at_once(settings: ServiceSettings, stop: asyncio.Event) -> None:
    assert settings.log.level == "error"
    assert not stop.is_set()


async def cannot_start(_settings: ServiceSettings, _stop: asyncio.Event) -> None:
    raise StartError("port 80 is taken; choose another by --http.port")


async def finds_bad_settings(_settings: ServiceSettings, _stop: asyncio.Event) -> None:
    raise ConfigurationError(["mqtt.password_file: cannot be read", "robot.name: is missing"])


async def loses_a_vital_task(_settings: ServiceSettings, stop: asyncio.Event) -> None:
    async def fail() -> None:
        raise RuntimeError("why")

    async with Supervisor() as tasks:
        tasks.start("mqtt", fail())
        await tasks.wait(stop)


async def loses_its_store(_settings: ServiceSettings, stop: asyncio.Event) -> None:
    async def fail() -> None:
        raise StartError("the file is gone")

    async with Supervisor() as tasks:
        tasks.start("store", fail())
        await tasks.wait(stop)


@pytest.mark.parametrize(
    ("serve", "status", "told"),
    [
        (end_at_once, 0, []),
        (cannot_start, EXIT_FAILED, ["example: port 80 is taken; choose another by --http.port"]),
        (
            finds_bad_settings,
            EXIT_MISCONFIGURED,
            [
                "example: setting mqtt.password_file: cannot be read",
                "example: setting robot.name: is missing",
            ],
        ),
        (loses_a_vital_task, EXIT_FAILED, ["example: task 'mqtt' has ended"]),
        (loses_its_store, EXIT_FAILED, ["example: task 'store' has ended: the file is gone"]),
    ],
)
def test_exit_status_and_last_lines(
    serve: object, status: int, told: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--log.level", "error", "--log.form", "json"]

    assert run(ServiceSettings, serve, program="example", description="", argv=options) == status  # type: ignore[arg-type] # one of four functions

    lines = capsys.readouterr().err.splitlines()
    assert [line for line in lines if not line.startswith("{")] == told


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_ends_the_process_in_order(number: signal.Signals, tmp_path: Path) -> None:
    file = tmp_path / "example.py"
    file.write_text(PROGRAM)
    told = tmp_path / "log"
    with (
        told.open("wb") as log,
        subprocess.Popen(
            [sys.executable, str(file)], stdout=subprocess.PIPE, stderr=log, text=True
        ) as process,
    ):
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        process.send_signal(number)

        assert process.stdout.readline() == "in order\n"
        assert process.wait(PATIENCE) == 0
    assert "program ended" in told.read_text()


@pytest.fixture
def supervisor(tmp_path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(str(tmp_path / "notify"))
        listener.settimeout(0)
        yield listener


def gather(listener: socket.socket, messages: list[str]) -> list[str]:
    while True:
        try:
            messages.append(listener.recv(200).decode())
        except BlockingIOError:
            return messages


async def test_systemd_is_notified_of_ready_watchdog_and_stopping(supervisor: socket.socket) -> None:
    stop, heard = asyncio.Event(), list[str]()
    environment = {"NOTIFY_SOCKET": supervisor.getsockname(), "WATCHDOG_USEC": "20000"}

    async with heartbeats(stop, environment):
        await until(lambda: gather(supervisor, heard).count("WATCHDOG=1") > 2)
        stop.set()
        await until(lambda: "STOPPING=1" in gather(supervisor, heard))
        ended = len(heard)
        await until(lambda: "WATCHDOG=1" in gather(supervisor, heard)[ended + 1 :])

    assert heard[0] == "READY=1"
    assert (heard.count("READY=1"), heard.count("STOPPING=1")) == (1, 1)


async def test_ready_is_resent_after_the_socket_was_full(supervisor: socket.socket) -> None:
    address, heard = supervisor.getsockname(), list[str]()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as other:
        with suppress(BlockingIOError):
            while True:
                other.sendto(b"other", address)

        environment = {"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "20000"}
        with capture_logs() as logged:
            async with heartbeats(asyncio.Event(), environment):
                await until(lambda: logged)
                await until(lambda: "READY=1" in gather(supervisor, heard))


async def test_stopping_is_sent_if_a_heartbeat_is_due_at_the_same_time(
    supervisor: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def set_too_late(event: asyncio.Event, seconds: float) -> bool:
        await time_passes(seconds)
        event.set()
        return False

    monkeypatch.setattr("nena_shared.program.set_within", set_too_late)
    heard = list[str]()
    environment = {"NOTIFY_SOCKET": supervisor.getsockname(), "WATCHDOG_USEC": "20000"}

    async with heartbeats(asyncio.Event(), environment):
        await until(lambda: "STOPPING=1" in gather(supervisor, heard))


async def test_abstract_socket_is_supported() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(f"\0nena-test-{os.getpid()}")
        listener.settimeout(0)

        Supervision.of({"NOTIFY_SOCKET": f"@nena-test-{os.getpid()}"}).notify("READY=1")

        assert gather(listener, []) == ["READY=1"]


async def test_heartbeat_updates_the_file(tmp_path: Path) -> None:
    file = tmp_path / "heartbeat"
    file.touch()
    os.utime(file, (0, 0))

    async with heartbeats(asyncio.Event(), {HEARTBEAT_FILE: str(file)}):
        await until(lambda: time.time() - file.stat().st_mtime < 60)


async def test_missing_supervisor_is_harmless(tmp_path: Path) -> None:
    environment = {"NOTIFY_SOCKET": str(tmp_path / "gone"), HEARTBEAT_FILE: str(tmp_path / "no" / "file")}

    async with heartbeats(asyncio.Event(), environment):
        task = next(each for each in asyncio.all_tasks() if each.get_name() == "heartbeats")
        await asyncio.wait({task}, timeout=0.05)
        assert not task.done()


@pytest.mark.parametrize(
    ("watchdog", "period"), [("30000000", 5.0), ("4000000", 2.0), ("", 5.0), ("0", 5.0), ("soon", 5.0)]
)
def test_heartbeats_are_sent_twice_per_watchdog_period(watchdog: str, period: float) -> None:
    assert Supervision.of({"NOTIFY_SOCKET": "/x", "WATCHDOG_USEC": watchdog}).period == period
