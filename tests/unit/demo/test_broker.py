from __future__ import annotations

from pathlib import Path

import pytest

from nena_demo import broker as module
from nena_demo.broker import mosquitto_path, start_broker
from nena_demo.processes import ChildFailedError, Processes
from support.broker import free_port


async def test_without_mosquitto_the_python_broker_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "mosquitto_path", lambda: None)
    async with Processes(tmp_path) as processes:
        await start_broker(processes, free_port(), "auto")

        assert (tmp_path / "amqtt.yaml").exists()
        assert not (tmp_path / "mosquitto.conf").exists()


async def test_mosquitto_gets_its_limits_and_no_delay(tmp_path: Path) -> None:
    assert mosquitto_path() is not None
    async with Processes(tmp_path) as processes:
        await start_broker(processes, free_port(), "mosquitto")

        configuration = (tmp_path / "mosquitto.conf").read_text()
    for line in ("set_tcp_nodelay true", "max_queued_messages 10000", "max_inflight_messages 200"):
        assert line in configuration.splitlines()


async def test_a_broker_that_cannot_start_is_told_with_its_log(tmp_path: Path) -> None:
    async with Processes(tmp_path) as processes:
        port = free_port()
        await start_broker(processes, port, "mosquitto")
        with pytest.raises((ChildFailedError, TimeoutError)):
            await second_broker(processes, port)


async def second_broker(processes: Processes, port: int) -> None:
    """A second broker on the same port answers nobody; the first one would, so only its end can tell."""
    child = await start_broker(processes, port, "mosquitto")
    await child.process.wait()
    child.check()
