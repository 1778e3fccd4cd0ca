"""Maps over a real broker, from a real web server, in a real folder: also after a restart."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest

from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, error_types, running_agent
from support.http_files import served_files
from support.robot_core import MAP, action, order
from support.schemas import schema_problems

pytestmark = pytest.mark.broker


def maps(state: dict[str, Any]) -> dict[tuple[str, str], str]:
    return {(each["mapId"], each["mapVersion"]): each["mapStatus"] for each in state["maps"]}


def in_attic(x: float) -> NodePosition:
    return NodePosition(x=x, y=0.0, map_id="attic")


@pytest.mark.clause("6.3", "6.2.3/downloadMap", "6.2.3/enableMap", "6.1.4.10")
@pytest.mark.parametrize(("version", "error_type"), [("2.1.0", "orderError"), ("3.0.0", "UNKNOWN_MAP_ID")])
async def test_map_is_downloaded_and_driven_on(
    broker: Broker, interface_name: str, tmp_path: Path, version: str, error_type: str
) -> None:
    folder = {"store": "folder", "folder": str(tmp_path / "maps")}
    settings = agent_settings(broker, interface_name, tmp_path, version=version, maps=folder)
    attic = order("n0", "n1", positions={"n0": in_attic(0.0), "n1": in_attic(1.0)})
    with MqttPeer(broker, f"{interface_name}/#") as peer, served_files() as files:
        fleet = FleetControl(peer, interface_name, version=version)
        async with running_agent(settings):
            await fleet.state(lambda state: maps(state) == {(MAP, "1"): "ENABLED"})
            fleet.send(attic)
            await fleet.state(lambda state: error_types(state) == [error_type])

            link = files.put("/attic", b"walls")
            which = {"mapId": "attic", "mapVersion": "3"}
            digest = sha256(b"walls").hexdigest()
            bring = action(
                "d", "NONE", "downloadMap", mapDownloadLink=link, mapHash=digest, retriable=None, **which
            )
            fleet.instant(bring)
            await fleet.state(lambda state: maps(state).get(("attic", "3")) == "DISABLED")
            fleet.instant(action("e", "NONE", "enableMap", retriable=None, **which))
            await fleet.state(lambda state: maps(state).get(("attic", "3")) == "ENABLED")

            place: dict[str, Any] = {"x": 0.0, "y": 0.0, "theta": 0.0, "mapId": "attic", "lastNodeId": "n0"}
            fleet.instant(action("p", "NONE", "initializePosition", retriable=None, **place))
            await fleet.state(lambda state: state["lastNodeId"] == "n0")
            fleet.send(attic)
            await fleet.state(ended("o1"))

        payloads = peer.payloads(fleet.topic(Topic.STATE))
        assert [problem for each in payloads for problem in schema_problems(version, Topic.STATE, each)] == []
        peer.clear()
        async with running_agent(settings):
            state = await fleet.state()
            assert maps(state) == {(MAP, "1"): "ENABLED", ("attic", "3"): "ENABLED"}
