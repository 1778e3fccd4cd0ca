"""The start of an agent: it is online while its driver starts, and reports when that is done."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_shared.tasks import StartError
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, running_agent
from support.robot_core import order
from support.waiting import until

pytestmark = pytest.mark.broker


@pytest.fixture
async def fleet(broker: Broker, interface_name: str) -> AsyncIterator[FleetControl]:
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        yield FleetControl(peer, interface_name)


async def test_the_robot_is_online_while_its_driver_starts(
    fleet: FleetControl, broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ready, start = asyncio.Event(), LoopbackDriver.start

    async def late(driver: LoopbackDriver) -> None:
        await ready.wait()
        await start(driver)

    monkeypatch.setattr(LoopbackDriver, "start", late)
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await until(lambda: fleet.connections == ["ONLINE"], what="the connection")
        assert fleet.states == []
        ready.set()
        await fleet.state()
        fleet.send(order("n0", "n1"))
        await fleet.state(ended("o1"))
    await until(lambda: fleet.connections == ["ONLINE", "OFFLINE"], what="the end of the connection")


async def test_a_driver_that_cannot_start_breaks_the_connection(
    fleet: FleetControl, broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def fail(_: LoopbackDriver) -> None:
        await until(lambda: fleet.connections == ["ONLINE"], what="the connection")
        message = "no wheels"
        raise StartError(message)

    monkeypatch.setattr(LoopbackDriver, "start", fail)
    with pytest.raises(StartError, match="no wheels"):
        async with running_agent(agent_settings(broker, interface_name, tmp_path)):
            await until(lambda: fleet.connections[1:], what="the end of the connection")
    assert fleet.connections == ["ONLINE", "CONNECTIONBROKEN"]
