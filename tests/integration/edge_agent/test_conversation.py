"""A loopback agent over a real broker: what fleet control sends, and what it reads."""

from __future__ import annotations

import json
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from nena_edge_agent.driver.port import DriveGoal
from nena_edge_agent.loopback.driver import LoopbackDriver
from nena_edge_agent.protocol import orders
from nena_edge_agent.protocol.robot_state import RobotState
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import (
    FleetControl,
    agent_settings,
    ended,
    error_types,
    running_agent,
    status_of,
)
from support.robot_core import MAP, action, order
from support.schemas import schema_problems
from support.waiting import until

pytestmark = pytest.mark.broker


@pytest.fixture
async def fleet(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> AsyncIterator[FleetControl]:
    """Yield fleet control of a robot that has sent its first state."""
    fleet = FleetControl(peer, interface_name)
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await fleet.state()
        yield fleet


@pytest.mark.clause("6.6.2", "7.8/loads", "6.2.3/pick")
async def test_order_is_executed_to_its_end(fleet: FleetControl) -> None:
    work = {"n1": [action("a", "HARD", "pick")], "n3": [action("b", "HARD", "drop")]}
    fleet.send(order("n0", "n1", "n2", "n3", node_actions=work))

    state = await fleet.state(ended("o1"))

    assert (state["lastNodeId"], state["lastNodeSequenceId"]) == ("n3", 6)
    assert (status_of(state, "a"), status_of(state, "b")) == ("FINISHED", "FINISHED")
    assert state["agvPosition"]["x"] == pytest.approx(30.0, abs=0.3)
    assert not state["driving"]
    assert not state["errors"]
    visited = list(dict.fromkeys(each["lastNodeId"] for each in fleet.states if each["orderId"]))
    assert visited == sorted(visited), "a state of a node that is passed may be left out"
    assert (len(visited) > 1, visited[-1]) == (True, "n3")
    assert any(each["loads"] for each in fleet.states)
    assert state["loads"] == []


@pytest.mark.clause("7.2/headerId")
async def test_header_ids_are_counted_per_topic(fleet: FleetControl) -> None:
    fleet.send(order("n0", "n1"))
    await fleet.state(ended("o1"))
    await fleet.peer.wait_for(fleet.topic(Topic.VISUALIZATION))

    for topic in (Topic.STATE, Topic.VISUALIZATION):
        numbers = [json.loads(each)["headerId"] for each in fleet.peer.payloads(fleet.topic(topic))]
        assert numbers == list(range(len(numbers)))


@pytest.mark.clause("6.6.3", "6.1.2/B6")
async def test_base_extended_in_time_is_driven_without_a_stop(fleet: FleetControl) -> None:
    fleet.send(order("n0", "n1", "n2", released=2))
    waiting = await fleet.state(lambda state: state["lastNodeId"] == "n1")
    assert [each["nodeId"] for each in waiting["nodeStates"]] == ["n2"]
    await fleet.state(lambda state: state["newBaseRequest"])

    fleet.send(order("n1", "n2", "n3", update=1, first=2))

    state = await fleet.state(ended("o1"))
    assert (state["orderUpdateId"], state["lastNodeId"]) == (1, "n3")


@pytest.mark.clause("6.1.4.1", "6.6.5.2", "6.6.1/request", "7.1/malformed")
async def test_malformed_order_is_rejected_and_the_robot_continues(fleet: FleetControl) -> None:
    fleet.peer.publish(fleet.topic(Topic.ORDER), '{"orderId": "bad", "orderUpdateId": 3, "nodes": []}')
    state = await fleet.state(lambda state: state["errors"])
    (error,) = state["errors"]
    assert (error["errorType"], error["errorLevel"]) == ("validationError", "WARNING")
    references = {each["referenceKey"]: each["referenceValue"] for each in error["errorReferences"]}
    assert references == {"topic": "order", "orderId": "bad", "orderUpdateId": "3", "parameter": "nodes"}
    assert state["orderId"] == ""

    for rubbish in (b"", b"\xff\xfe", b"[]", b"null", b'{"nodes": ' + b"[" * 5000):
        fleet.peer.publish(fleet.topic(Topic.ORDER), rubbish)
        fleet.peer.publish(fleet.topic(Topic.INSTANT_ACTIONS), rubbish)
    fleet.send(order("n0", "n1"))

    state = await fleet.state(ended("o1"))
    about = {each["referenceValue"] for error in state["errors"] for each in error["errorReferences"]}
    assert about == {"instantActions"}, "an order ends what was said of orders"
    fleet.instant(action("s", "NONE", "stateRequest"))
    await fleet.state(lambda state: state["orderId"] == "o1" and not state["errors"])


@pytest.mark.clause("7.2")
async def test_order_for_another_robot_is_rejected(fleet: FleetControl) -> None:
    wrong = json.dumps(
        {
            "headerId": 5,
            "timestamp": "2026-01-01T00:00:00Z",
            "version": "2.1.0",
            "manufacturer": "ACME",
            "serialNumber": "0002",
            "actions": [],
        }
    )
    fleet.peer.publish(fleet.topic(Topic.INSTANT_ACTIONS), wrong)

    state = await fleet.state(lambda state: state["errors"])

    assert error_types(state) == ["validationError"]
    assert "ACME/0002" in state["errors"][0]["errorDescription"]


@pytest.mark.clause("7.2/version")
@pytest.mark.parametrize(
    ("version", "of_the_node", "taken"),
    [
        ("2.0.0", {}, True),
        ("3.0.0", {}, True),
        ("1.3.2", {}, True),
        ("3.0.0", {"nodePosition": {"x": 0.0, "y": 0.0, "mapId": "map", "allowedDeviationXy": 1.0}}, False),
    ],
)
async def test_the_topic_decides_the_version(
    fleet: FleetControl,
    version: str,
    of_the_node: dict[str, object],
    taken: bool,  # noqa: FBT001
) -> None:
    fleet.send(order("n0", "n1", order_id="first"))
    await fleet.state(ended("first"))
    payload = json.loads(fleet.peer.payloads(fleet.topic(Topic.ORDER))[0])
    payload |= {"version": version, "orderId": "second", "nodes": payload["nodes"][1:], "edges": []}
    payload["nodes"][0] |= {"sequenceId": 0, **of_the_node}

    fleet.peer.publish(fleet.topic(Topic.ORDER), json.dumps(payload))

    state = await fleet.state(lambda state: state["orderId"] == "second" or state["errors"])
    assert (state["orderId"] == "second") is taken


@pytest.mark.clause("6.1.3")
async def test_cancel_stops_the_driving_robot(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> None:
    slow = {"speed": 2.0, "pose_interval": 0.02, "turn_rate": 50.0}
    fleet = FleetControl(peer, interface_name)
    async with running_agent(agent_settings(broker, interface_name, tmp_path, loopback=slow)):
        await fleet.state()
        fleet.send(order("n0", "n1", "n2"))
        await fleet.state(lambda state: state["driving"])

        fleet.instant(action("c", "NONE", "cancelOrder"))

        state = await fleet.state(lambda state: status_of(state, "c") == "FINISHED")
        assert (state["nodeStates"], state["edgeStates"], state["driving"]) == ([], [], False)
        assert (state["orderId"], state["lastNodeId"]) == ("o1", "n0")
        assert state["agvPosition"]["x"] < 10.0


@pytest.mark.clause("4.1/retain")
async def test_retained_order_is_not_executed(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> None:
    fleet = FleetControl(peer, interface_name)
    fleet.send(order("n0", "n1"))
    (payload,) = await until(lambda: peer.payloads(fleet.topic(Topic.ORDER)))
    peer.publish(fleet.topic(Topic.ORDER), payload, retain=True)

    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await fleet.state()
        fleet.instant(action("r", "NONE", "stateRequest"))
        state = await fleet.state(lambda state: status_of(state, "r") == "FINISHED")

    assert (state["orderId"], state["errors"]) == ("", [])
    peer.publish(fleet.topic(Topic.ORDER), b"", retain=True)


@pytest.mark.clause("6.5", "6.5/start", "4.1/retain", "6.10")
async def test_publishes_connection_factsheet_and_state_at_startup_and_offline_at_the_end(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> None:
    fleet = FleetControl(peer, interface_name)
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await fleet.state()
        topics = [each.topic.rsplit("/", 1)[1] for each in peer.received()]
        topics = [each for each in topics if each != "visualization"]  # comes at a time of its own
        assert topics[:3] == ["connection", "factsheet", "state"]
        with MqttPeer(broker, f"{interface_name}/#") as late:
            kept = await late.wait_for(fleet.topic(Topic.CONNECTION))
            assert kept.retained
            assert json.loads(kept.payload)["connectionState"] == "ONLINE"
            assert (await late.wait_for(fleet.topic(Topic.FACTSHEET))).retained

    await until(lambda: len(fleet.connections) > 1)
    assert fleet.connections == ["ONLINE", "OFFLINE"]


@pytest.mark.clause("6.2.3/factsheetRequest", "6.10")
async def test_a_factsheet_request_is_answered(fleet: FleetControl) -> None:
    fleet.instant(action("f", "NONE", "factsheetRequest"))

    await fleet.state(lambda state: status_of(state, "f") == "FINISHED")
    await until(lambda: len(fleet.peer.payloads(fleet.topic(Topic.FACTSHEET))) == 2)


@pytest.mark.clause("7.7", "7.8", "7.9", "7.10/message")
async def test_published_messages_match_the_official_schemas(fleet: FleetControl) -> None:
    fleet.send(order("n0", "n1", "n2", released=2, node_actions={"n1": [action("a", "SOFT", "pick")]}))
    await fleet.state(lambda state: status_of(state, "a") == "FINISHED")
    fleet.send(order("n5", order_id="o2"))
    fleet.instant(action("x", "NONE", "dance"))
    await fleet.state(lambda state: len(state["errors"]) > 1)
    await fleet.peer.wait_for(fleet.topic(Topic.VISUALIZATION))

    for topic in (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET, Topic.VISUALIZATION):
        for payload in fleet.peer.payloads(fleet.topic(topic)):
            assert not schema_problems("2.1.0", topic.value, payload)


async def test_fleet_of_loopback_robots_runs_in_one_process(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> None:
    many = {"count": 5, "spacing": 10.0, "speed": 50.0, "turn_rate": 50.0}
    async with running_agent(agent_settings(broker, interface_name, tmp_path, loopback=many)):
        fleets = [FleetControl(peer, interface_name, f"0001-{number}") for number in range(1, 6)]
        for index, fleet in enumerate(fleets):
            await fleet.state()
            fleet.send(order(f"n{index}", f"n{index + 5}"))
        for index, fleet in enumerate(fleets):
            state = await fleet.state(ended("o1"))
            assert state["lastNodeId"] == f"n{index + 5}"
            assert state["serialNumber"] == f"0001-{index + 1}"


async def test_disk_failure_is_reported_and_the_order_waits(fleet: FleetControl, tmp_path: Path) -> None:
    journal = tmp_path / "ACME.0001.new"
    journal.mkdir()
    (tmp_path / "ACME.0001.journal").unlink()  # another one cannot be made now
    fleet.send(order("n0", "n1"))
    state = await fleet.state(lambda state: "JOURNAL_NOT_WRITTEN" in error_types(state))
    assert (state["orderId"], state["lastNodeId"]) == ("", "")

    journal.rmdir()

    await fleet.state(lambda state: ended("o1")(state) and not state["errors"])


async def test_hanging_disk_is_reported_and_the_order_waits(fleet: FleetControl, tmp_path: Path) -> None:
    journal = tmp_path / "ACME.0001.new"
    os.mkfifo(journal)  # opening it for writing takes until somebody reads
    (tmp_path / "ACME.0001.journal").unlink()
    fleet.send(order("n0", "n1"))
    await fleet.state(lambda state: "JOURNAL_NOT_WRITTEN" in error_types(state))

    with journal.open("rb"):
        journal.unlink()

    await fleet.state(lambda state: ended("o1")(state) and not state["errors"])
    assert '"order_id":"o1"' in (tmp_path / "ACME.0001.journal").read_text()


@pytest.mark.provokes_failures
async def test_exception_in_the_core_loses_one_message_only(
    fleet: FleetControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    receive = orders.receive

    def receive_or_fail(robot: RobotState, order: Order) -> object:
        if order.order_id == "fatal":
            message = "a fault of the program"
            raise RuntimeError(message)
        return receive(robot, order)

    monkeypatch.setattr(orders, "receive", receive_or_fail)
    fleet.send(order("n0", "n1", order_id="fatal"))
    fleet.send(order("n0", "n1", order_id="good"))

    state = await fleet.state(ended("good"))
    assert state["lastNodeId"] == "n1"


@pytest.mark.clause("6.6.5.1/keeps")
async def test_driver_failure_is_an_error_in_the_state(
    fleet: FleetControl, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: LoopbackDriver, goal: DriveGoal) -> None:
        message = f"no goal {goal.generation} today"
        raise RuntimeError(message)

    monkeypatch.setattr(LoopbackDriver, "go_to", fail)
    fleet.send(order("n0", "n1"))

    state = await fleet.state(lambda state: state["errors"])

    assert error_types(state) == ["nodeUnreachable"]
    assert "no goal 1 today" in state["errors"][0]["errorDescription"]
    assert (state["lastNodeId"], state["driving"]) == ("n0", False)
    fleet.instant(action("c", "NONE", "cancelOrder"))
    state = await fleet.state(lambda state: status_of(state, "c") == "FINISHED")
    assert not state["errors"]


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause", "6.6.9")
async def test_action_is_paused_and_resumed(fleet: FleetControl) -> None:
    fleet.send(order("n0", node_actions={"n0": [action("a", "HARD", "wait", duration=3.0)]}))
    await fleet.state(lambda state: status_of(state, "a") == "RUNNING")

    fleet.instant(action("p", "NONE", "startPause"))
    state = await fleet.state(lambda state: status_of(state, "a") == "PAUSED")
    assert state["paused"]
    fleet.instant(action("s", "NONE", "stopPause"))

    state = await fleet.state(ended("o1"))
    assert status_of(state, "a") == "FINISHED"


@pytest.mark.clause("6.1.3/actions")
async def test_running_action_is_cancelled_with_its_order(fleet: FleetControl) -> None:
    fleet.send(order("n0", "n1", node_actions={"n0": [action("a", "HARD", "wait", duration=60)]}))
    await fleet.state(lambda state: status_of(state, "a") == "RUNNING")

    fleet.instant(action("c", "NONE", "cancelOrder"))

    state = await fleet.state(lambda state: status_of(state, "c") == "FINISHED")
    assert (status_of(state, "a"), state["nodeStates"]) == ("FAILED", [])


@pytest.mark.clause("6.2.3/initializePosition")
async def test_init_position_sets_the_pose(fleet: FleetControl) -> None:
    place: dict[str, Any] = {"x": 50.0, "y": 0.0, "theta": 1.0, "mapId": MAP, "lastNodeId": "n5"}
    fleet.instant(action("i", "NONE", "initializePosition", **place))

    state = await fleet.state(lambda state: status_of(state, "i") == "FINISHED")

    assert (state["lastNodeId"], state["agvPosition"]["x"]) == ("n5", 50.0)
    fleet.send(order("n5", "n6"))
    assert (await fleet.state(ended("o1")))["lastNodeId"] == "n6"
