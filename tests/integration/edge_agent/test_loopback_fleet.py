"""A fleet of loopback robots in one program: each is reached by its name, and each fails alone."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.queues import Mailbox
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.state import OperatingMode
from support.broker import Broker, MqttPeer
from support.edge_agent import QUICK, SERIAL, agent_settings, running_agent
from support.loopback_bench import BenchRobot, errors
from support.robot_core import order
from support.waiting import until

pytestmark = pytest.mark.broker

FLEET: dict[str, Any] = {**QUICK, "count": 2, "control": True, "restart_pause": 0.05, "restarts": 1000}


def robots(peer: MqttPeer, interface_name: str) -> list[BenchRobot]:
    serials = (f"{SERIAL}-{number}" for number in (1, 2))
    return [BenchRobot(peer, interface_name, serial=each, version="2.1.0") for each in serials]


async def test_command_reaches_only_the_named_robot(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    settings = agent_settings(broker, interface_name, tmp_path, loopback=FLEET)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        first, second = robots(peer, interface_name)
        async with running_agent(settings):
            await first.state(lambda _: True)
            await second.state(lambda _: True)
            assert (await second.command("operatingMode", mode="MANUAL"))["accepted"]
            await second.state(lambda state: state.operating_mode is OperatingMode.MANUAL)
            assert (await first.command("pauseButton", pressed=True))["accepted"]
            paused = await first.state(lambda state: state.paused)

        assert paused.operating_mode is OperatingMode.AUTOMATIC


async def test_robot_with_a_damaged_journal_waits_while_the_others_work(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    damaged = tmp_path / f"ACME.{SERIAL}-1.journal"
    damaged.write_text("{")
    settings = agent_settings(broker, interface_name, tmp_path, loopback=FLEET)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        first, second = robots(peer, interface_name)
        async with running_agent(settings):
            lost = await first.state(lambda state: "JOURNAL_LOST" in errors(state))
            assert ErrorLevel.FATAL in {each.error_level for each in lost.errors}
            assert (await second.command("pauseButton", pressed=True))["accepted"]
            await second.state(lambda state: state.paused and not errors(state))

            first.fleet.send(order("n0", "n1"))
            stands = await first.state(lambda state: len(state.errors) > len(lost.errors))
        assert (stands.order_id, stands.node_states) == ("", ())

        damaged.unlink()
        async with running_agent(settings):
            await first.state(lambda state: not errors(state))


@pytest.mark.clause("6.5")
async def test_robot_with_a_failed_task_is_reported_as_broken_until_its_restart(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fault, wait = asyncio.Event(), Mailbox.wait

    async def faulty(mailbox: Mailbox, seconds: float) -> None:
        """Fail once, for the robot that comes first."""
        await wait(mailbox, min(seconds, 0.05))
        if fault.is_set():
            fault.clear()
            message = "a fault of the program"
            raise RuntimeError(message)

    monkeypatch.setattr(Mailbox, "wait", faulty)
    settings = agent_settings(broker, interface_name, tmp_path, loopback=FLEET)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        both = robots(peer, interface_name)
        async with running_agent(settings):
            for robot in both:
                await robot.state(lambda _: True)
            fault.set()
            await until(lambda: max(len(each.fleet.connections) for each in both) >= 3)

            told = sorted((each.fleet.connections for each in both), key=len)
            assert told == [["ONLINE"], ["ONLINE", "CONNECTIONBROKEN", "ONLINE"]]
        await until(lambda: all(each.fleet.connections[-1] == "OFFLINE" for each in both))
