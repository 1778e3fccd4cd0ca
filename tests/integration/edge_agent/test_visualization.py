"""Where the robot is, for displays, at a rate of its own."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, running_agent
from support.robot_core import order
from support.schemas import schema_problems
from support.waiting import until

pytestmark = [pytest.mark.broker, pytest.mark.clause("6.7", "7.9")]


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
async def test_it_shows_the_robot_on_its_way(
    broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    settings = agent_settings(
        broker, interface_name, tmp_path, version=version, interval={"visualization": 0.02}
    )
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name, version=version)
        topic = fleet.topic(Topic.VISUALIZATION)
        async with running_agent(settings):
            await fleet.state()
            fleet.send(order("n0", "n1"))
            await fleet.state(ended("o1"))
            shown = len(peer.payloads(topic))
            await until(lambda: len(peer.payloads(topic)) > shown)

    position = "mobileRobotPosition" if version == "3.0.0" else "agvPosition"
    payloads = peer.payloads(topic)
    messages = [json.loads(each) for each in payloads]
    places = [each[position]["x"] for each in messages]  # none before there is a position
    assert places == sorted(places)
    assert (places[0], places[-1]) == (0.0, pytest.approx(10.0, abs=0.3))
    assert any(each.get("velocity", {}).get("vx") for each in messages)
    assert [problem for each in payloads for problem in schema_problems(version, "visualization", each)] == []
    if version == "3.0.0":
        states = {json.loads(each)["headerId"] for each in peer.payloads(fleet.topic(Topic.STATE))}
        references = [each["referenceStateHeaderId"] for each in messages]
        assert references == sorted(references)
        assert set(references) <= states | {0}
        assert len(set(references)) > 1
