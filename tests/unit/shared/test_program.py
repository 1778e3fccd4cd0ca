"""How a program ends: in this process, and as a process that gets signals."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from nena_shared.program import EXIT_FAILED, EXIT_MISCONFIGURED, StartError, run
from nena_shared.settings import ConfigurationError, ServiceSettings
from nena_shared.tasks import Supervisor
from support.waiting import PATIENCE

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


def test_bad_setting_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["--mqtt.port", "0"]

    assert run(ServiceSettings, end_at_once, program="example", description="", argv=argv) == 2

    assert capsys.readouterr().err == (
        "example: setting mqtt.port: Input should be greater than or equal to 1\n"
    )


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
