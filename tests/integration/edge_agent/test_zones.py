"""Zones over a real broker: a set is sent, enabled and obeyed, a zone is requested and left."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio

from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.v3_0 import CODEC
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, error_types, running_agent
from support.http_files import served_files
from support.robot_core import action, order
from support.schemas import schema_problems
from support.zones import responses, transfer, zone

pytestmark = pytest.mark.broker

WALL = zone("wall", "BLOCKED", 13, 17)
GATE = zone("gate", "RELEASE", 13, 17)


@pytest_asyncio.fixture
async def fleet(broker: Broker, interface_name: str, tmp_path: Path) -> AsyncIterator[FleetControl]:
    settings = agent_settings(broker, interface_name, tmp_path, version="3.0.0")
    with MqttPeer(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name, version="3.0.0")
        async with running_agent(settings):
            await fleet.state()
            yield fleet
        payloads = peer.payloads(fleet.topic(Topic.STATE))
        assert [problem for each in payloads for problem in schema_problems("3.0.0", Topic.STATE, each)] == []


def status(state: dict[str, Any], action_id: str) -> str | None:
    states = (each for each in state["instantActionStates"] if each["actionId"] == action_id)
    return next((each["actionStatus"] for each in states), None)


def sets(state: dict[str, Any]) -> dict[str, str]:
    return {each["zoneSetId"]: each["zoneSetStatus"] for each in state["zoneSets"]}


def requested(state: dict[str, Any]) -> dict[str, str]:
    return {each["zoneId"]: each["requestStatus"] for each in state.get("zoneRequests", [])}


async def enable(fleet: FleetControl, zone_set_id: str) -> None:
    fleet.instant(action(f"e-{zone_set_id}", "NONE", "enableZoneSet", zoneSetId=zone_set_id))
    await fleet.state(lambda state: sets(state).get(zone_set_id) == "ENABLED")


@pytest.mark.clause("6.4/BLOCKED", "6.4.1", "6.4.2", "6.1.4.8")
async def test_order_through_a_blocked_zone_is_rejected_while_its_set_is_enabled(
    fleet: FleetControl,
) -> None:
    fleet.publish(Topic.ZONE_SET, transfer(WALL))
    await fleet.state(lambda state: sets(state) == {"s1": "DISABLED"})
    await enable(fleet, "s1")

    fleet.send(order("n0", "n1", "n2"))
    await fleet.state(lambda state: "NO_ROUTE_TO_TARGET" in error_types(state))

    fleet.publish(Topic.ZONE_SET, transfer(zone("far", "BLOCKED", 90, 91), zone_set_id="s2"))
    await enable(fleet, "s2")
    fleet.send(order("n0", "n1", "n2"))
    await fleet.state(ended("o1"))


@pytest.mark.clause("6.4.3", "6.9")
async def test_release_zone_is_requested_entered_and_released(fleet: FleetControl) -> None:
    fleet.publish(Topic.ZONE_SET, transfer(GATE))
    await enable(fleet, "s1")

    fleet.send(order("n0", "n1", "n2"))
    waiting = await fleet.state(
        lambda state: requested(state) == {"gate": "REQUESTED"} and state["lastNodeId"] == "n1"
    )
    assert not waiting["driving"]
    request_id = waiting["zoneRequests"][0]["requestId"]
    fleet.publish(Topic.RESPONSES, responses(request_id, "GRANTED"))

    await fleet.state(lambda state: requested(state) == {"gate": "GRANTED"})
    done = await fleet.state(ended("o1"))
    assert done["lastNodeId"] == "n2"
    await fleet.state(lambda state: requested(state) == {} and state["lastNodeId"] == "n2")


@pytest.mark.clause("6.4.1")
async def test_duplicate_zone_set_is_reported(fleet: FleetControl) -> None:
    fleet.publish(Topic.ZONE_SET, transfer(WALL))
    fleet.publish(Topic.ZONE_SET, transfer(GATE))

    state = await fleet.state(lambda state: "DUPLICATE_ZONE_SET" in error_types(state))

    assert sets(state) == {"s1": "DISABLED"}


@pytest.mark.clause("6.2.3/downloadZoneSet")
async def test_zone_set_is_downloaded_on_request(fleet: FleetControl) -> None:
    with served_files() as files:
        link = files.put("/zones.json", CODEC.encode(transfer(WALL)))
        fleet.instant(action("d", "NONE", "downloadZoneSet", zoneSetId="s1", zoneSetDownloadLink=link))
        state = await fleet.state(lambda state: status(state, "d") == "FINISHED")

    assert sets(state) == {"s1": "DISABLED"}


@pytest.mark.clause("7.6")
async def test_invalid_zone_set_is_rejected(fleet: FleetControl) -> None:
    fleet.peer.publish(fleet.topic(Topic.ZONE_SET), b'{"zoneSet": {}}')

    await fleet.state(lambda state: "VALIDATION_FAILURE" in error_types(state))
