"""A loopback robot over a broker: actions that use ROS are refused, or rehearsed; its load stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from structlog.testing import capture_logs

from support.broker import Broker
from support.edge_agent import FleetControl, agent_settings, ended, error_types, running_agent, status_of
from support.robot_core import action, hard, order
from support.waiting import until

pytestmark = pytest.mark.broker

COMMAND = {
    "topic": "lift",
    "type": "acme_msgs/msg/Lift",
    "fields": {"height": "{height}"},
    "on_cancel": {"stop": True},
}
HEIGHT = {"key": "height", "type": "NUMBER", "maximum": 2}


def lifting(action_type: str, load: str) -> dict[str, Any]:
    return {
        "kind": "topic",
        "action_type": action_type,
        "load": load,
        "parameters": [HEIGHT],
        "command": COMMAND,
    }


OPERATIONS = [lifting("pick", "take"), lifting("drop", "give"), {"kind": "dock", "action_type": "dock"}]


@pytest.mark.clause("6.1.4.3")
async def test_ros_action_is_rejected_without_ros_before_the_robot_drives(
    broker: Broker, interface_name: str, fleet: FleetControl, tmp_path: Path
) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path, operations=OPERATIONS)):
        await fleet.state()
        fleet.send(order("n0", "n1", node_actions={"n1": [hard("p", "pick", height=1)]}))
        state = await fleet.state(error_types)

        assert error_types(state) == ["orderError"]
        assert "it needs ROS, which this robot does not have" in state["errors"][0]["errorDescription"]
        assert state["lastNodeId"] == ""


@pytest.mark.clause("6.2.3/pick", "7.8/loads")
async def test_rehearsed_actions_complete_an_order_and_the_load_survives_a_restart(
    broker: Broker, interface_name: str, fleet: FleetControl, tmp_path: Path
) -> None:
    actions = {"without_ros": "rehearse", "rehearsal_seconds": 0.05}
    settings = agent_settings(broker, interface_name, tmp_path, operations=OPERATIONS, actions=actions)
    async with running_agent(settings):
        await fleet.state()
        fleet.send(order("n0", order_id="high", node_actions={"n0": [hard("x", "pick", height=3)]}))
        await fleet.state(lambda state: error_types(state) == ["orderError"])
        taken = {"n0": [hard("p", "pick", height=1, loadId="box")], "n1": [hard("k", "dock")]}
        fleet.send(order("n0", "n1", order_id="fetch", node_actions=taken))
        done = await fleet.state(ended("fetch"))
        assert [status_of(done, each) for each in ("p", "k")] == ["FINISHED"] * 2
        assert done["agvPosition"]["x"] == pytest.approx(10.5, abs=0.15)

    fleet.peer.clear()
    async with running_agent(settings):
        again = await fleet.state()
        assert [each["loadId"] for each in again["loads"]] == ["box"]

        fleet.send(order("n1", order_id="twice", node_actions={"n1": [hard("p2", "pick", height=1)]}))
        refused = await fleet.state(lambda state: error_types(state) == ["orderError"])
        assert "already loaded" in refused["errors"][0]["errorDescription"]

        fleet.send(order("n1", order_id="bring", node_actions={"n1": [hard("d", "drop", height=0)]}))
        assert (await fleet.state(ended("bring")))["loads"] == []


async def test_the_end_of_each_action_is_logged_once_per_run(
    broker: Broker, interface_name: str, fleet: FleetControl, tmp_path: Path
) -> None:
    """What was done is known by the log, also where the broker has lost the states."""
    actions = {"without_ros": "rehearse", "rehearsal_seconds": 0.05}
    settings = agent_settings(broker, interface_name, tmp_path, operations=OPERATIONS, actions=actions)
    taken = {"n0": [hard("p", "pick", height=1, loadId="box")], "n1": [hard("k", "dock")]}
    with capture_logs() as logs:
        async with running_agent(settings):
            await fleet.state()
            fleet.send(order("n0", "n1", order_id="fetch", node_actions=taken))
            await fleet.state(ended("fetch"))
            seen = len(fleet.states)
            fleet.instant(action("s", "NONE", "stateRequest"))
            await until(lambda: len(fleet.states) > seen, what="a state that shows the same actions again")
        fleet.peer.clear()
        async with running_agent(settings):
            await fleet.state(ended("fetch"))

    told = [
        (each["order"], each["action"], each["type"], each["status"])
        for each in logs
        if each["event"] == "action ended"
    ]
    both = [("fetch", "p", "pick", "FINISHED"), ("fetch", "k", "dock", "FINISHED")]
    assert told[:2] == both
    assert sorted(told[2:]) == sorted(both)


@pytest.mark.parametrize(("serial_number", "said"), [("robot.1", True), ("robot-1", False)])
async def test_names_that_some_brokers_refuse_are_named_at_the_start(
    broker: Broker, interface_name: str, tmp_path: Path, serial_number: str, *, said: bool
) -> None:
    settings = agent_settings(broker, interface_name, tmp_path, serial_number=serial_number)
    with capture_logs() as logs:
        async with running_agent(settings):
            await until(lambda: any(each["event"] == "broker connected" for each in logs), what="a link")
    assert (
        any(serial_number in str(each.get("robots")) and "rename" in each["event"] for each in logs) is said
    )
