"""The robot's position for displays, at a separate rate."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from pathlib import Path

import pytest

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.agent import RobotAgent
from nena_edge_agent.driver.port import Pose, PoseReport
from nena_shared.clock import SystemClock
from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, make_robot, running_agent
from support.robot_core import MAP, order
from support.schemas import schema_problems
from support.scripted_driver import ScriptedDriver
from support.waiting import PATIENCE, until

pytestmark = [pytest.mark.broker, pytest.mark.clause("6.7", "7.9")]


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
async def test_visualization_shows_the_driving_robot(
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
            await until(lambda: peer.payloads(topic))
            fleet.send(order("n0", "n1"))
            await fleet.state(ended("o1"))
            shown = len(peer.payloads(topic))
            await until(lambda: len(peer.payloads(topic)) > shown)

    position = "mobileRobotPosition" if version == "3.0.0" else "agvPosition"
    payloads = peer.payloads(topic)
    messages = [json.loads(each) for each in payloads]
    places = [each[position]["x"] for each in messages]
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


async def test_no_visualization_before_the_robot_is_localised(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    intervals = {"visualization": 0.02, "state_minimum": 0.02, "state_maximum": 0.05}
    settings = agent_settings(broker, interface_name, tmp_path, interval=intervals)
    emitted: list[Callable[[PoseReport], None]] = []

    def make_driver(emit: Callable[..., None], _: Pose | None) -> ScriptedDriver:
        emitted.append(emit)
        return ScriptedDriver()

    agent = RobotAgent(settings, make_robot(), make_driver, ActionRegistry(()), clock=SystemClock())
    stop = asyncio.Event()
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name)
        task = asyncio.create_task(agent.run(stop), name="agent under test")
        states, shown = fleet.topic(Topic.STATE), fleet.topic(Topic.VISUALIZATION)
        await until(lambda: len(peer.payloads(states)) > 10, what="time enough for several of them")
        assert peer.payloads(shown) == []

        emitted[0](PoseReport(Pose(1.0, 2.0, 0.0, MAP), localized=True))
        payloads = await until(lambda: peer.payloads(shown), what="the position")
        stop.set()
        await asyncio.wait_for(task, PATIENCE)

    assert all("agvPosition" in json.loads(each) for each in payloads)
