from __future__ import annotations

import asyncio
import sys
from pathlib import Path

import pytest

from nena_demo import processes as module
from nena_demo.processes import ChildFailedError, Processes, start_broker
from nena_demo.processes import free_port as chosen_port
from support.broker import free_port
from support.waiting import until

SLEEPS = (sys.executable, "-c", "import signal; print('up', flush=True); signal.pause()")
STUBBORN = (
    sys.executable,
    "-c",
    "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('up', flush=True); signal.pause()",
)


async def test_child_that_ignores_sigterm_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "STOP_SECONDS", 0.2)
    async with Processes(tmp_path) as processes:
        child = await processes.start("stubborn", STUBBORN)
        await until(lambda: "up" in child.tail(), what="it is up")

    assert child.process.returncode == -9


async def test_ended_child_is_reported_with_the_end_of_its_log(tmp_path: Path) -> None:
    async with Processes(tmp_path) as processes:
        child = await processes.start(
            "broken", (sys.executable, "-c", "print('no broker'); raise SystemExit(3)")
        )
        await child.process.wait()

        with pytest.raises(ChildFailedError, match=r"broken ended with status 3(.|\n)*no broker"):
            processes.check()


async def test_killed_child_comes_back_however_often(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LOOK_EVERY", 0.01)
    async with Processes(tmp_path) as processes:
        child = await processes.start("victim", SLEEPS)
        keeper = asyncio.create_task(processes.keep_running(lambda _: None))
        for _ in range(module.QUICK_ENDS + 3):
            killed = child.process
            await processes.kill(child)
            await until(lambda killed=killed: child.process is not killed, what="it is back")  # type: ignore[misc]
        assert not keeper.done()
        keeper.cancel()


async def test_python_broker_is_used_without_mosquitto(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "mosquitto_path", lambda: None)
    async with Processes(tmp_path) as processes:
        await start_broker(processes, free_port(), "auto")

        assert (tmp_path / "amqtt.yaml").exists()
        assert not (tmp_path / "mosquitto.conf").exists()


async def test_broker_that_cannot_start_is_reported_with_its_log(tmp_path: Path) -> None:
    async with Processes(tmp_path) as processes:
        port = free_port()
        await start_broker(processes, port, "mosquitto")
        with pytest.raises((ChildFailedError, TimeoutError)):
            await second_broker(processes, port)


async def second_broker(processes: Processes, port: int) -> None:
    """Start a second broker on the same port, which answers no client; only its end shows that."""
    child = await start_broker(processes, port, "mosquitto")
    await child.process.wait()
    child.check()


def test_no_robot_can_get_the_port_of_a_service_that_starts_later() -> None:
    ephemeral, _ = map(int, Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split())
    assert all(chosen_port() < ephemeral for _ in range(20))
