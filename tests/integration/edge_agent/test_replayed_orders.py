"""An order captured on its way to a robot, and published again when the robot is back where it began."""

from __future__ import annotations

from pathlib import Path

import pytest
from structlog.testing import capture_logs

from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, ended, error_types, running_agent
from support.robot_core import action, order
from support.waiting import until

pytestmark = pytest.mark.broker

ERROR = {"2.0.0": "orderUpdateError", "2.1.0": "orderUpdateError", "3.0.0": "OUTDATED_ORDER_UPDATE"}


@pytest.mark.clause("6.1.4.4", "6.6/restart")
@pytest.mark.parametrize("version", ERROR)
@pytest.mark.parametrize("restarted", [False, True])
async def test_replayed_order_is_not_executed_again(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path, version: str, *, restarted: bool
) -> None:
    settings = agent_settings(broker, interface_name, tmp_path, version=version)
    fleet = FleetControl(peer, interface_name, version=version)
    fleet.honest_headers = True
    with capture_logs() as logs:
        async with running_agent(settings):
            await fleet.state()
            fleet.send(order("n0", "n1", order_id="there"))
            await fleet.state(ended("there"))
            fleet.send(order("n1", "n0", order_id="back"))
            await fleet.state(ended("back"))
            captured, _ = peer.payloads(fleet.topic(Topic.ORDER))
            if not restarted:
                await replay(fleet, captured, ERROR[version])
        if restarted:
            before = len(fleet.states)
            async with running_agent(settings):
                await until(lambda: len(fleet.states) > before, what="a state of the restarted agent")
                await replay(fleet, captured, ERROR[version])

    told = [each for each in logs if each["event"] == "error reported" and "'there'" in each["description"]]
    assert [each["error_type"] for each in told] == ["OUTDATED_ORDER_UPDATE"]


async def replay(fleet: FleetControl, captured: bytes, error_type: str) -> None:
    """Publish an old order again: it is refused, changes nothing, and the next order is done."""
    fleet.peer.publish(fleet.topic(Topic.ORDER), captured)
    state = await fleet.state(lambda state: error_type in error_types(state))
    assert (state["orderId"], state["lastNodeId"], state["driving"]) == ("back", "n0", False)
    fleet.instant(action("s", "NONE", "stateRequest"))

    fleet.send(order("n0", "n2", order_id="next"))

    state = await fleet.state(ended("next"))
    assert (state["lastNodeId"], state["errors"]) == ("n2", [])


@pytest.mark.clause("7.2/headerId")
async def test_fleet_control_may_restart_its_header_ids_at_0(
    broker: Broker, peer: MqttPeer, interface_name: str, tmp_path: Path
) -> None:
    fleet = FleetControl(peer, interface_name)
    fleet.honest_headers = True
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await fleet.state()
        for index in range(3):
            fleet.send(order(f"n{index}", f"n{index + 1}", order_id=f"o{index}"))
            await fleet.state(ended(f"o{index}"))
        again = FleetControl(peer, interface_name)
        again.honest_headers = True

        again.send(order("n3", "n4", order_id="o3"))

        state = await again.state(ended("o3"))
        assert (state["lastNodeId"], state["errors"]) == ("n4", [])
