"""The agent speaks the version that its settings name, on the topics of that version."""

from __future__ import annotations

from pathlib import Path

import pytest

from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, running_agent
from support.robot_core import action, order
from support.schemas import schema_problems

pytestmark = pytest.mark.broker


@pytest.mark.clause("4.2", "7.2", "7.7", "7.8", "7.9", "7.10/message")
@pytest.mark.parametrize("version", CODECS)
async def test_order_is_executed_and_every_message_conforms_to_the_version(
    broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    settings = agent_settings(broker, interface_name, tmp_path, version=version)
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name, version=version)
        async with running_agent(settings):
            await fleet.state()
            fleet.send(order("n0", "n1", "n2", node_actions={"n1": [action("a", "HARD", "pick")]}))
            state = await fleet.state(ended("o1"))
            await peer.wait_for(fleet.topic(Topic.VISUALIZATION))

        assert state["version"] == version
        assert state["lastNodeId"] == "n2"
        for topic in (Topic.CONNECTION, Topic.FACTSHEET, Topic.STATE, Topic.VISUALIZATION):
            payloads = peer.payloads(fleet.topic(topic))
            assert payloads
            problems = [problem for each in payloads for problem in schema_problems(version, topic, each)]
            assert problems == []
