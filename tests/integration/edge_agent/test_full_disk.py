"""A disk that becomes full during an order; a limit on the size of files has that effect."""

from __future__ import annotations

import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import codec_for
from support.broker import Broker
from support.edge_agent import AgentProcess, FleetControl, ended, error_types
from support.restarts.oracle import check_headers, check_states
from support.robot_core import order
from support.waiting import until

pytestmark = pytest.mark.broker
ROOM = 100
"""Bytes: the journal is longer."""


@pytest.fixture
def agent(broker: Broker, interface_name: str, tmp_path: Path) -> Iterator[AgentProcess]:
    with AgentProcess(broker, interface_name, tmp_path, "--loopback.speed", "5") as agent:
        yield agent


def fill(agent: AgentProcess, *, full: bool) -> None:
    """Make the disk full for the agent, or free again."""
    _, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.prlimit(agent.process.pid, resource.RLIMIT_FSIZE, (ROOM if full else hard, hard))


def full_disk(state: dict[str, Any]) -> bool:
    """Return whether a state reports that as a problem for a person."""
    return any(
        e["errorType"] == "JOURNAL_NOT_WRITTEN" and e["errorLevel"] == "FATAL" for e in state["errors"]
    )


def refused(order_id: str) -> Any:
    """Accept a state that refuses an order."""

    def accept(state: dict[str, Any]) -> bool:
        references = [each for error in state["errors"] for each in error.get("errorReferences", ())]
        return {"referenceKey": "orderId", "referenceValue": order_id} in references

    return accept


def check_all(fleet: FleetControl) -> None:
    """Check that nothing was taken back, and that no headerId came twice."""
    codec, topic = codec_for("2.1.0"), fleet.topic(Topic.STATE)
    payloads = [each.payload for each in fleet.peer.history if each.topic == topic]
    check_states([codec.decode(State, each) for each in payloads])
    check_headers((topic, each) for each in payloads)


@pytest.mark.clause("6.6.5.4")
async def test_order_that_cannot_be_saved_is_neither_reported_nor_started(
    fleet: FleetControl, agent: AgentProcess
) -> None:
    await fleet.state()
    fill(agent, full=True)
    fleet.send(order("n0", "n1", order_id="first"))
    await fleet.state(full_disk)
    fleet.send(order("n0", "n1", order_id="second"))
    state = await fleet.state(refused("second"))
    assert state["orderId"] == ""
    assert not state["driving"]
    assert all(each["agvPosition"]["x"] == 0.0 for each in fleet.states)

    fill(agent, full=False)
    state = await fleet.state(ended("first"))

    assert error_types(state) == []
    check_all(fleet)


@pytest.mark.clause("6.6.5.4", "6.6/restart")
async def test_agent_killed_with_a_full_disk_loses_nothing_it_reported(
    fleet: FleetControl, agent: AgentProcess
) -> None:
    await fleet.state()
    fleet.send(order("n0", "n1", "n2", "n3", "n4"))
    await fleet.state(lambda state: state["lastNodeId"] == "n1")
    fill(agent, full=True)
    stands = await fleet.state(lambda state: full_disk(state) and not state["driving"])
    shown = stands["lastNodeId"]
    assert shown in ("n1", "n2", "n3")

    agent.kill()
    fleet.peer.clear()
    agent.restart()

    first = await fleet.state()
    assert first["lastNodeId"] == shown
    await fleet.state(ended("o1"))
    check_all(fleet)


@pytest.mark.clause("6.6.5.4", "6.6/restart")
async def test_robot_with_a_lost_journal_reports_it_and_rejects_orders(
    broker: Broker, interface_name: str, fleet: FleetControl, tmp_path: Path
) -> None:
    (tmp_path / "ACME.0001.journal").write_bytes(b"torn")
    with AgentProcess(broker, interface_name, tmp_path) as agent:
        state = await fleet.state(lambda state: "JOURNAL_LOST" in error_types(state))
        (lost,) = (each for each in state["errors"] if each["errorType"] == "JOURNAL_LOST")
        assert lost["errorLevel"] == "FATAL"
        assert "remove " in lost["errorDescription"]
        fleet.send(order("n0", "n1"))
        await fleet.state(refused("o1"))
        agent.terminate()
        await until(lambda: "OFFLINE" in fleet.connections, what="its farewell, after all that it has said")
        assert (tmp_path / "ACME.0001.journal").read_bytes() == b"torn", "it is a person's to look at"

        (tmp_path / "ACME.0001.journal").unlink()
        fleet.peer.clear()
        agent.restart()
        assert error_types(await fleet.state()) == []
        fleet.send(order("n0", "n1", order_id="o2"))
        await fleet.state(lambda state: state["orderId"] == "o2")
