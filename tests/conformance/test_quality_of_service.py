from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import pytest
from paho.mqtt.client import Client, MQTTMessage

from nena_conversations.kit.honest_robot import ROBOT
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.topics import Topic
from support.broker import Broker, MqttPeer
from support.edge_agent import FleetControl, agent_settings, running_agent
from support.fleet import make_vda_order
from support.waiting import until
from support.wired_robot import WiredFleet, WiredRobot

pytestmark = [pytest.mark.broker, pytest.mark.clause("4.1/qos")]


class Listener(MqttPeer):
    """A peer that also notes with which quality each topic's messages come."""

    def __init__(self, broker: Broker, *topic_filters: str) -> None:
        self.qualities: dict[str, set[int]] = {}
        super().__init__(broker, *topic_filters)

    def _record(self, _client: Client, _userdata: Any, message: MQTTMessage) -> None:
        self.qualities.setdefault(message.topic.rsplit("/", 1)[1], set()).add(message.qos)
        super()._record(_client, _userdata, message)


@pytest.mark.parametrize("qos", [0, 1])
async def test_robot_publishes_connection_with_qos_1_and_states_as_configured(
    broker: Broker, interface_name: str, tmp_path: Path, qos: int
) -> None:
    with Listener(broker, f"{interface_name}/#") as peer:
        fleet = FleetControl(peer, interface_name)
        async with running_agent(agent_settings(broker, interface_name, tmp_path, qos=qos)):
            await fleet.state()
            await peer.wait_for(fleet.topic(Topic.VISUALIZATION))

    assert peer.qualities == {"connection": {1}, "factsheet": {qos}, "state": {qos}, "visualization": {0}}


@pytest.mark.parametrize("qos", [0, 1])
async def test_fleet_control_publishes_orders_as_configured(
    broker: Broker, interface_name: str, qos: Literal[0, 1]
) -> None:
    settings = FleetSettings(qos=qos, tick_interval=0.02)
    with Listener(broker, f"{interface_name}/+/+/+/order") as peer:
        async with (
            WiredFleet(broker, interface_name, settings).connected() as fleet,
            WiredRobot(broker, interface_name).connected(),
        ):
            await until(lambda: fleet.fleet.view(ROBOT).availability.can_take_order, what="a free robot")
            fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
            await fleet.wait_for("VdaOrderAccepted")

    assert peer.qualities == {"order": {qos}}


def test_the_setting_may_be_a_text_as_on_the_command_line() -> None:
    assert FleetSettings.model_validate({"qos": "0"}).qos == 0
