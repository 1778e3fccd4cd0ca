"""The program in a separate process: killed, restarted, disconnected, and started by mistake."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import AgentProcess, FleetControl, ended, status_of
from support.robot_core import action, order
from support.waiting import PATIENCE, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

SLOW = ("--loopback.speed", "10", "--loopback.turn_rate", "50", "--loopback.pose_interval", "0.02")
WAY = ("n0", "n1", "n2", "n3")


@asynccontextmanager
async def started(
    broker: Broker, interface_name: str, folder: Path, *options: str
) -> AsyncIterator[tuple[FleetControl, AgentProcess]]:
    """Start the program, and wait for its first state."""
    with (
        MqttPeer(broker, f"{interface_name}/#") as peer,
        AgentProcess(broker, interface_name, folder, *options) as agent,
    ):
        fleet = FleetControl(peer, interface_name)
        await fleet.state()
        yield fleet, agent


@pytest.mark.clause("4.1/will", "6.5")
async def test_last_will_reports_a_killed_agent(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    async with started(broker, interface_name, tmp_path) as (fleet, agent):
        agent.kill()

        await until(lambda: len(fleet.connections) > 1)
        assert fleet.connections == ["ONLINE", "CONNECTIONBROKEN"]
    with MqttPeer(broker, f"{interface_name}/#") as late:
        will = await late.wait_for(fleet.topic(Topic.CONNECTION))
        assert will.retained
        assert json.loads(will.payload)["connectionState"] == "CONNECTIONBROKEN"


@pytest.mark.clause("6.5")
async def test_terminated_agent_reports_offline(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    async with started(broker, interface_name, tmp_path) as (fleet, agent):
        assert agent.terminate() == 0

        await until(lambda: len(fleet.connections) > 1)
        assert fleet.connections == ["ONLINE", "OFFLINE"]


@pytest.mark.clause("6.6/restart")
async def test_order_continues_after_kill_9(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    """Killed on the way, in an action and at a node: traversed nodes stay so, finished actions too."""
    work = {
        "n1": [action("a", "HARD", "wait", duration=1.0)],
        "n2": [action("b", "HARD", "wait", duration=1.0)],
    }
    moments = (
        lambda state: state["driving"] and state["lastNodeId"] == "n0",
        lambda state: status_of(state, "a") == "RUNNING",
        lambda state: status_of(state, "a") == "FINISHED",
        lambda state: state["lastNodeId"] == "n2",
    )
    async with started(broker, interface_name, tmp_path, *SLOW) as (fleet, agent):
        fleet.send(order(*WAY, node_actions=work))
        for moment in moments:
            await fleet.state(moment)
            agent.kill()
            agent.restart()

        state = await fleet.state(ended("o1"))

        assert state["lastNodeId"] == "n3"
        assert (status_of(state, "a"), status_of(state, "b")) == ("FINISHED", "FINISHED")
        numbers = [each["lastNodeSequenceId"] for each in fleet.states if each["orderId"]]
        assert numbers == sorted(numbers)
        assert all(each["orderId"] for each in fleet.states[fleet.states.index(state) :])
        after = next(i for i, each in enumerate(fleet.states) if status_of(each, "a") == "FINISHED")
        assert all(status_of(each, "a") == "FINISHED" for each in fleet.states[after:])


@pytest.mark.clause("6.2.3/startPause")
async def test_a_paused_robot_is_still_paused_after_kill_9(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with started(broker, interface_name, tmp_path, *SLOW) as (fleet, agent):
        fleet.send(order(*WAY))
        fleet.instant(action("p", "NONE", "startPause"))
        await fleet.state(lambda state: status_of(state, "p") == "FINISHED")

        agent.kill()
        fleet.peer.clear()
        agent.restart()

        state = await fleet.state()
        assert (state["paused"], state["orderId"]) == (True, "o1")
        fleet.instant(action("s", "NONE", "stopPause"))
        assert (await fleet.state(ended("o1")))["lastNodeId"] == "n3"


@pytest.mark.clause("4.1/offline", "4.1", "6.5/start")
async def test_robot_drives_without_a_broker_and_reports_correctly_afterwards(
    own_broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    with AgentProcess(own_broker, interface_name, tmp_path, *SLOW):
        with MqttPeer(own_broker, f"{interface_name}/#") as peer:
            fleet = FleetControl(peer, interface_name)
            await fleet.state()
            fleet.send(order(*WAY, node_actions={"n3": [action("a", "HARD", "wait", duration=0.5)]}))
            await fleet.state(lambda state: state["driving"])
        own_broker.restart()

        with MqttPeer(own_broker, f"{interface_name}/#") as peer:
            fleet = FleetControl(peer, interface_name)
            state = await fleet.state(ended("o1"))

        assert state["lastNodeId"] == "n3"
        assert fleet.connections == ["ONLINE"]
        first = [each.topic.rsplit("/", 1)[1] for each in peer.received()]
        first = [each for each in first if each != "visualization"]  # comes at a time of its own
        assert set(first[:3]) == {"connection", "factsheet", "state"}


def run(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "nena_edge_agent", *options]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)


def test_invalid_setting_is_one_clear_line() -> None:
    result = run("--driver", "loopback", "--serial_number", "a/b")

    assert result.returncode == 2
    assert result.stderr.count("\n") == 1
    assert "serial_number" in result.stderr


def test_unusable_journal_folder_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    result = run("--driver", "loopback", "--journal.folder", str(tmp_path / "file"))

    assert result.returncode == 1
    assert result.stderr.startswith("nena-edge-agent: the journal's folder ")
    assert result.stderr.count("\n") == 1
    assert "set journal.folder" in result.stderr


def test_help_lists_the_settings() -> None:
    result = run("--help")

    assert result.returncode == 0
    assert all(word in result.stdout for word in ("--serial_number", "--mqtt.host", "--loopback.count"))
