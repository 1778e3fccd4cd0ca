"""Signs of life, against a real socket in the place of systemd's."""

from __future__ import annotations

import asyncio
import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from nena_shared.signs_of_life import HEARTBEAT_FILE, Supervision, signs_of_life
from support.waiting import until


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


async def test_systemd_hears_ready_the_watchdog_and_the_end(supervisor: socket.socket) -> None:
    stop, heard = asyncio.Event(), list[str]()
    environment = {"NOTIFY_SOCKET": supervisor.getsockname(), "WATCHDOG_USEC": "20000"}

    async with signs_of_life(stop, environment):
        await until(lambda: gather(supervisor, heard).count("WATCHDOG=1") > 2)
        stop.set()
        await until(lambda: "STOPPING=1" in gather(supervisor, heard))
        ended = len(heard)
        await until(lambda: "WATCHDOG=1" in gather(supervisor, heard)[ended + 1 :])

    assert heard[0] == "READY=1"
    assert (heard.count("READY=1"), heard.count("STOPPING=1")) == (1, 1)


async def test_an_abstract_socket_is_understood() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(f"\0nena-test-{os.getpid()}")
        listener.settimeout(0)

        Supervision.of({"NOTIFY_SOCKET": f"@nena-test-{os.getpid()}"}).tell("READY=1")

        assert gather(listener, []) == ["READY=1"]


async def test_the_file_grows_younger(tmp_path: Path) -> None:
    file = tmp_path / "heartbeat"
    file.touch()
    os.utime(file, (0, 0))

    async with signs_of_life(asyncio.Event(), {HEARTBEAT_FILE: str(file)}):
        await until(lambda: time.time() - file.stat().st_mtime < 60)


async def test_a_supervisor_that_is_gone_costs_nothing(tmp_path: Path) -> None:
    environment = {"NOTIFY_SOCKET": str(tmp_path / "gone"), HEARTBEAT_FILE: str(tmp_path / "no" / "file")}

    async with signs_of_life(asyncio.Event(), environment):
        task = next(each for each in asyncio.all_tasks() if each.get_name() == "signs of life")
        await asyncio.wait({task}, timeout=0.05)
        assert not task.done()


async def test_without_a_supervisor_there_is_no_task() -> None:
    async with signs_of_life(asyncio.Event(), {}):
        assert all(each.get_name() != "signs of life" for each in asyncio.all_tasks())


@pytest.mark.parametrize(
    ("watchdog", "period"), [("30000000", 5.0), ("4000000", 2.0), ("", 5.0), ("0", 5.0), ("soon", 5.0)]
)
def test_signs_come_twice_as_often_as_systemd_wants_them(watchdog: str, period: float) -> None:
    assert Supervision.of({"NOTIFY_SOCKET": "/x", "WATCHDOG_USEC": watchdog}).period == period
